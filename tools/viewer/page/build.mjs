// Bundles the page, or with --tests its tests, which need Node alone then.
//
//   node build.mjs [--outdir FOLDER]   both pages, viewer.js, spheres.js, ...; dist unless said
//   node build.mjs --tests             build/tests/*.js
import { copyFile, mkdir, readdir, readFile } from "node:fs/promises";
import path from "node:path";
import { fileURLToPath } from "node:url";
import { build } from "esbuild";

const here = path.dirname(fileURLToPath(import.meta.url));

async function buildPage(folder) {
  await mkdir(folder, { recursive: true });
  await build({
    entryPoints: { viewer: path.join(here, "src/main.ts"), spheres: path.join(here, "src/spheres/main.ts") },
    outdir: folder,
    bundle: true,
    minify: true,
    format: "iife",
    target: ["es2022", "chrome100", "firefox100", "safari15.4"],
    legalComments: "eof",
  });
  for (const name of ["index.html", "spheres.html", "icon.svg"]) await copyFile(path.join(here, name), path.join(folder, name));
  // The licences of what is bundled want to be kept with it.
  await mkdir(path.join(folder, "licences"), { recursive: true });
  const { dependencies } = JSON.parse(await readFile(path.join(here, "package.json"), "utf8"));
  for (const name of Object.keys(dependencies)) {
    await copyFile(path.join(here, "node_modules", name, "LICENSE"), path.join(folder, "licences", name));
  }
}

async function buildTests() {
  const tests = (await readdir(path.join(here, "tests"))).filter((name) => name.endsWith(".ts"));
  await build({
    entryPoints: tests.map((name) => path.join(here, "tests", name)),
    outdir: path.join(here, "build/tests"),
    bundle: true,
    packages: "external",
    platform: "node",
    format: "esm",
    target: "node18",
    sourcemap: "inline",
  });
}

const outdir = process.argv.indexOf("--outdir");
if (process.argv.includes("--tests")) {
  await buildTests();
} else {
  await buildPage(outdir < 0 ? path.join(here, "dist") : path.resolve(process.argv[outdir + 1]));
}
