// What Python has put into a page, and the notice where it cannot be shown.

/** What an element holds, one after the other: gzip, in base64. */
export function unpacked(id: string): Promise<ArrayBuffer[]> {
  const words = document.getElementById(id)?.textContent?.trim().split(/\s+/) ?? [];
  return Promise.all(words.map(unpackedWord));
}

async function unpackedWord(word: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(word), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Response(stream).arrayBuffer();
}

/** Says why the page does not start. */
export function sayFailure(error: unknown): never {
  const note = document.getElementById("error");
  if (note) {
    note.hidden = false;
    note.textContent = `The page cannot start: ${error instanceof Error ? error.message : error}`;
  }
  throw error;
}
