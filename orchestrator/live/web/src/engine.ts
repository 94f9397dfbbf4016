// The part of the page that needs no document: it runs in Node, too.
export * from "./types";
