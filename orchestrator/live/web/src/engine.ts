// The part of the page that needs no document, for Node.
export { apiWithoutPage } from "./api";
export { chatters, movingMean } from "./chatter";
export { metrics } from "./signals";
export { Engine } from "./simulate";
