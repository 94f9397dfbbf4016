// The part of the page that needs no document: it runs in Node, too.
export { type Api, apiWithoutPage, makeApi } from "./api";
export { Refusal } from "./experiment";
export {
  commandName,
  controlPoint,
  inSteps,
  limits,
  metrics,
  reference,
  smallestDistance,
  trackingError,
} from "./signals";
export { Engine } from "./simulate";
export { csv } from "./text";
export type * from "./types";
