// Prepares a transcript for `diff`: lines whose numbers differ from those of the kept ones by rounding alone
// become the kept ones. Whole numbers have to be equal.
//
//   node settle.mjs EXPECTED SEEN
import { existsSync, readdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";

// A unit of the sixth digit, or of the fifth of an array's numbers, may be a hundred-thousandth of a number.
const kRelative = 2e-5;
const kAbsolute = 2e-9;
const kNumber = /(?<![\w.])-?\d+(?:\.\d+)?(?:e[+-]?\d+)?(?!\w)/g;

const isWhole = (text) => !/[.e]/.test(text);

function isNear(one, other) {
  if (one === other) return true;
  if (isWhole(one) && isWhole(other)) return false;
  const a = Number(one), b = Number(other);
  return Math.abs(a - b) <= Math.max(kAbsolute, kRelative * Math.max(Math.abs(a), Math.abs(b)));
}

/// The address, and the value without its numbers.
function formOf(line) {
  const end = Math.max(line.indexOf(" = "), 0);
  return line.slice(0, end) + line.slice(end).replace(kNumber, "#");
}

function settle(kept, seen) {
  const byForm = new Map();
  for (const line of kept) {
    const form = formOf(line);
    if (!byForm.has(form)) byForm.set(form, []);
    byForm.get(form).push(line);
  }
  return seen.map((line) => {
    const like = byForm.get(formOf(line))?.shift() ?? "";
    const theirs = like.match(kNumber) ?? [], ours = line.match(kNumber) ?? [];
    const isLike = like !== "" && ours.every((number, i) => isNear(number, theirs[i]));
    return isLike ? like : line;
  });
}

const [expected, seen] = process.argv.slice(2);
for (const run of readdirSync(seen)) {
  for (const file of readdirSync(join(seen, run))) {
    const paths = [join(expected, run, file), join(seen, run, file)];
    if (!existsSync(paths[0])) continue;
    const [kept, ours] = paths.map((path) => readFileSync(path, "utf8").split("\n"));
    writeFileSync(paths[1], settle(kept, ours).join("\n"));
  }
}
