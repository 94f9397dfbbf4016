// The engine in a worker, so that the page never waits for a run.

import { Engine, Refusal, type Runner, resultOf } from "./simulate";
import type { Data, LoopData, Options, Outcome, Result, Values } from "./types";

/** Content of the page: its data as text in JSON, and its modules. */
interface Parts {
  readonly data: ArrayBuffer;
  readonly modules: readonly ArrayBuffer[];
}

/** A run that the page asks for. */
interface Request {
  /** Number of the loop among the loops of all presets. */
  readonly loop: number;
  readonly values: Values;
  readonly options: Options;
}

/** An answer, in the order of the requests. */
interface Answer {
  readonly outcome?: Outcome;
  readonly refusal?: string;
  readonly error?: string;
}

/** Reads data of the page. */
export function dataOf(content: ArrayBuffer): Data {
  return JSON.parse(new TextDecoder().decode(content));
}

function loopsOf(data: Data): LoopData[] {
  return data.presets.flatMap(({ loops }) => loops);
}

/** Answers requests; the first message has the parts. */
export function serve(): void {
  let answer: Promise<(request: Request) => Answer> | undefined;
  addEventListener("message", async ({ data }: MessageEvent) => {
    if (answer === undefined) {
      answer = answering(data);
      return;
    }
    const made: Answer = await answer
      .then((one) => one(data))
      .catch((error) => ({ error: `${error}` }));
    postMessage(made, { transfer: made.outcome ? [made.outcome.table.buffer] : [] });
  });
}

async function answering({ data: content, modules }: Parts): Promise<(request: Request) => Answer> {
  const data = dataOf(content);
  const engine = await Engine.load(modules, data);
  const loops = loopsOf(data);
  return ({ loop, values, options }) => {
    try {
      return { outcome: engine.outcome(loops[loop], values, options) };
    } catch (error) {
      if (error instanceof Refusal) return { refusal: error.message };
      throw error;
    }
  };
}

/** An engine in a worker of its own. */
export class RemoteEngine implements Runner {
  readonly #worker: Worker;
  readonly #loops: readonly LoopData[];
  readonly #waiting: ((answer: Answer) => void)[] = [];

  /** Starts a worker with the script of the page. */
  constructor(script: string, parts: Parts, data: Data) {
    this.#loops = loopsOf(data);
    const address = URL.createObjectURL(new Blob([script], { type: "text/javascript" }));
    this.#worker = new Worker(address);
    this.#worker.onmessage = ({ data: answer }) => this.#waiting.shift()?.(answer);
    this.#worker.onerror = ({ message }) => {
      for (const answer of this.#waiting.splice(0)) answer({ error: message || "no worker" });
    };
    this.#worker.postMessage(parts);
  }

  async run(loop: LoopData, values: Values, options: Options): Promise<Result> {
    const { spare } = options;
    const request: Request = { loop: this.#loops.indexOf(loop), values, options };
    const { outcome, refusal, error } = await new Promise<Answer>((answer) => {
      this.#waiting.push(answer);
      this.#worker.postMessage(request, spare ? [spare] : []);
    });
    if (refusal !== undefined) throw new Refusal(refusal);
    if (outcome === undefined) throw new Error(error);
    return resultOf(loop, outcome);
  }
}
