// Elements of the page, and the data that Python has put into it.

/** Returns an element of the page. */
export function element<T extends HTMLElement>(id: string): T {
  const found = document.getElementById(id);
  if (!found) throw new Error(`no element ${id}`);
  return found as T;
}

/** Makes an element with a class and content. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  className: string,
  ...content: readonly (string | Node)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  if (className) made.className = className;
  made.append(...content);
  return made;
}

/** Makes a field for a number. */
export function numberField(): HTMLInputElement {
  const input = document.createElement("input");
  input.type = "text";
  input.inputMode = "decimal";
  return input;
}

/** Unpacks the parts of an element: words in base64, compressed with gzip. */
export function unpacked(id: string): Promise<ArrayBuffer[]> {
  const words = document.getElementById(id)?.textContent?.trim().split(/\s+/) ?? [];
  return Promise.all(words.map(unpackedWord));
}

async function unpackedWord(word: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(word), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Shows why the page does not start. */
export function sayFailure(error: unknown): never {
  const note = document.getElementById("error");
  if (note) {
    note.hidden = false;
    note.textContent = `The page cannot start: ${error instanceof Error ? error.message : error}`;
  }
  throw error;
}
