// Bundles the page: `node build.mjs FOLDER` writes live.js, view.js, page.css, engine.mjs
// and licences.txt.
import { readdirSync, readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const [folder] = process.argv.slice(2);

/** Bundles an entry; returns the names of the packages in it. */
async function bundle(entry, outfile, options) {
  const { metafile } = await build({
    entryPoints: [`src/${entry}`],
    outfile: `${folder}/${outfile}`,
    bundle: true,
    // Text that would end the element in the page, such as `</script`, is escaped.
    platform: "browser",
    target: "es2022",
    legalComments: "none",
    metafile: true,
    logLevel: "warning",
    ...options,
  });
  const packages = Object.keys(metafile.inputs).map(
    (path) => path.match(/node_modules\/((@[^/]+\/)?[^/]+)/)?.[1],
  );
  return packages.filter((name) => name !== undefined);
}

const names = [
  ...(await bundle("live.ts", "live.js", { format: "iife", minify: true })),
  ...(await bundle("view.ts", "view.js", { format: "iife", minify: true })),
  ...(await bundle("style.css", "page.css", { minify: true })),
];
await bundle("engine.ts", "engine.mjs", { format: "esm", platform: "node" });

const licences = [...new Set(names)].sort().map((name) => {
  const place = `node_modules/${name}`;
  const { version, license } = JSON.parse(readFileSync(`${place}/package.json`, "utf8"));
  const file = readdirSync(place).find((path) => /^licen[cs]e/i.test(path));
  // The licence of ogl is in its README, under a heading.
  const text = file
    ? readFileSync(`${place}/${file}`, "utf8")
    : readFileSync(`${place}/README.md`, "utf8").split(`\n## ${license}\n`)[1];
  if (!text?.trim()) throw new Error(`${name} has no text of its licence`);
  return `${name} ${version}, ${license}\n\n${text.trim()}\n`;
});
writeFileSync(`${folder}/licences.txt`, licences.join("\n\n"));
