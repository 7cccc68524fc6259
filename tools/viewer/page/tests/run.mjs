// Runs the compiled tests with Node's own test runner.
//
//   node tests/run.mjs unit    what needs Node alone
//   node tests/run.mjs e2e     the page in headless Chromium; exits with 77 where there is none
//   node tests/run.mjs command the same, with what the command itself serves
import { spawnSync } from "node:child_process";
import { existsSync, readdirSync } from "node:fs";
import path from "node:path";
import { fileURLToPath } from "node:url";

const suite = process.argv[2];
const folder = path.join(path.dirname(fileURLToPath(import.meta.url)), "../build/tests");
const chromium = process.env.SIDESTEP_CHROMIUM ?? "/usr/bin/chromium";

if (suite !== "unit" && !existsSync(chromium)) {
  console.log(`skipped: no ${chromium} (Debian's package chromium; SIDESTEP_CHROMIUM names another one)`);
  process.exit(77);
}
const suiteOf = (name) => (name.startsWith("e2e_") ? "e2e" : name.startsWith("command_") ? "command" : "unit");
const files = readdirSync(folder)
  .filter((name) => name.endsWith("_test.js") && suiteOf(name) === suite)
  .map((name) => path.join(folder, name));
if (files.length === 0) {
  console.error(`no compiled tests in ${folder}`);
  process.exit(1);
}
const run = spawnSync(process.execPath, ["--test", ...files], {
  stdio: "inherit",
  env: { ...process.env, SIDESTEP_CHROMIUM: chromium },
});
process.exit(run.status ?? 1);
