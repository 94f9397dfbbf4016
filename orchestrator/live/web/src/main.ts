// The page: it reads what Python has put into it, runs the preset that is opened, and draws it.

import { type Api, Engine, makeApi } from "./engine";
import { Page } from "./page";
import type { Data } from "./types";

/** What an element holds, one after the other: gzip, in base64. */
function unpacked(id: string): Promise<ArrayBuffer[]> {
  const words = document.getElementById(id)?.textContent?.trim().split(/\s+/) ?? [];
  return Promise.all(words.map(unpackedWord));
}

async function unpackedWord(word: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(word), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

async function start(): Promise<Api> {
  const [[data], modules] = await Promise.all([unpacked("data"), unpacked("modules")]);
  const found: Data = JSON.parse(new TextDecoder().decode(data));
  const engine = await Engine.load(modules, found);
  return makeApi(found, engine, new Page(found, engine));
}

const started = start();
document.querySelector("form")?.addEventListener("submit", (event) => event.preventDefault());
const api: Api = {
  set: async (changes) => (await started).set(changes),
  csv: async () => (await started).csv(),
};
Object.assign(globalThis, { auvfmu: api });

started.catch((error: unknown) => {
  const note = document.getElementById("error");
  if (!note) throw error;
  note.hidden = false;
  note.textContent = `The page cannot start: ${error instanceof Error ? error.message : error}`;
  throw error;
});
