// Bundles the page's script: `node build.mjs ENTRY OUT`, for example src/main.ts page.js.
import { build } from "esbuild";

const [entry, outfile] = process.argv.slice(2);
await build({
  entryPoints: [entry],
  outfile,
  bundle: true,
  format: outfile.endsWith(".mjs") ? "esm" : "iife",
  platform: outfile.endsWith(".mjs") ? "node" : "browser",
  minify: outfile.endsWith(".js"),
  target: "es2022",
  legalComments: "eof",
  external: ["playwright-core"],
  logLevel: "warning",
});
