// Builds ../dist/viewer.html of the sources here: one page with style, script and worker, and
// places for the scene, which the program fills. With --check it compares instead of writing.
import { build } from "esbuild";
import { readFile, writeFile } from "node:fs/promises";

const PAGE = new URL("../dist/viewer.html", import.meta.url);
const source = (name) => new URL(name, import.meta.url);

async function bundle(entry, plugins = []) {
  const result = await build({
    entryPoints: [source(entry).pathname],
    bundle: true,
    write: false,
    minify: true,
    format: "iife",
    target: "es2022",
    charset: "utf8",
    legalComments: "none",
    plugins,
  });
  return result.outputFiles[0].text.trim();
}

// A page from disk may not load a worker from a file: its script travels as text.
const worker = await bundle("src/worker.ts");
const workerText = {
  name: "worker-text",
  setup(b) {
    b.onResolve({ filter: /^worker:text$/ }, () => ({ path: "worker", namespace: "worker-text" }));
    b.onLoad({ filter: /.*/, namespace: "worker-text" }, () => ({ contents: worker, loader: "text" }));
  },
};
const script = await bundle("src/main.ts", [workerText]);
if (/<\/script/i.test(script)) throw new Error("the script would end itself");

const style = await build({
  entryPoints: [source("style.css").pathname],
  write: false,
  minify: true,
  charset: "utf8",
});
const parts = { STYLE: style.outputFiles[0].text.trim(), SCRIPT: script };
const template = await readFile(source("page.html"), "utf8");
const page = template.replace(/@(STYLE|SCRIPT)@/g, (_, name) => parts[name]);

if (process.argv.includes("--check")) {
  const committed = await readFile(PAGE, "utf8");
  if (committed !== page) {
    console.error("viewer/dist/viewer.html is not what its sources make: npm run build");
    process.exit(1);
  }
  console.log("viewer/dist/viewer.html is what its sources make");
} else {
  await writeFile(PAGE, page);
  console.log(`viewer/dist/viewer.html: ${page.length} bytes`);
}
