// The part of the page that needs no document: it runs in Node, too.
export { type Api, apiWithoutPage, makeApi } from "./api";
export { csv } from "./csv";
export { Refusal } from "./experiment";
export { controlPoint, limits, metrics, trackingError } from "./indices";
export { Engine } from "./simulate";
export type * from "./types";
