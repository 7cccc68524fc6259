// Writes what a user sees of one run as lines of text, so that `diff` can compare two runs.
//
//   node transcribe.mjs RUN SEEN [COMPARISON]
//
// RUN         the folder of a run; beside it lie RUN.code, RUN.stdout and RUN.stderr
// SEEN        the folder for the texts: ends.txt, files.txt, summary.txt, results.txt, table.txt, ...
// COMPARISON  what is to be left out, by its name in masks.mjs
//
// What may differ between two runs of one build is masked (masks.mjs), every other number rounded
// (lines.mjs).
import { existsSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { addDatabase } from "./database.mjs";
import { Lines, plain } from "./lines.mjs";
import { addPage, addTerminal } from "./tables.mjs";

/// Elements by their `name` where all names differ, else by their index.
function namesOf(list) {
  const names = list.map((element) => element?.name);
  const differ = names.every((name) => typeof name === "string") && new Set(names).size === names.length;
  return differ ? names : list.map((_, index) => index);
}

/// The order of keys is no matter of a reader's.
function addJson(address, value, lines) {
  const isContainer = typeof value === "object" && value !== null;
  if (!isContainer || Object.keys(value).length === 0) return lines.add(address, value);
  if (Array.isArray(value)) {
    const names = namesOf(value);
    value.forEach((element, index) => addJson(`${address}[${names[index]}]`, element, lines));
  } else {
    for (const key of Object.keys(value).sort()) addJson(`${address}.${key}`, value[key], lines);
  }
}

function parseCsv(text) {
  const rows = [[]];
  for (const [, inQuotes, bare, end] of text.matchAll(/(?:"((?:[^"]|"")*)"|([^,\n]*))(,|\n|$)/g)) {
    rows.at(-1).push(inQuotes !== undefined ? inQuotes.replaceAll('""', '"') : bare);
    if (end === "\n") rows.push([]);
    if (end === "") break;
  }
  return rows.filter((row) => row.length > 1 || row[0] !== "");
}

function addCsv(text, lines) {
  const [header, ...rows] = parseCsv(text);
  lines.say(`columns: ${header.join(", ")}`);
  rows.forEach((row, r) => {
    row.forEach((cell, c) => {
      const isNumber = cell !== "" && Number.isFinite(Number(cell));
      lines.add(`row ${r}, ${header[c]}`, isNumber ? Number(cell) : cell);
    });
  });
}

/// Progress on stderr comes by the clock; where a run ends with a mistake or a fault, it says why.
function addEnd(run, lines) {
  const read = (what) => readFileSync(`${run}.${what}`, "utf8");
  const code = Number(read("code"));
  lines.say(`exit code: ${code}`);
  addTerminal(read("stdout").replaceAll(`${run}/`, "RUN/"), lines);
  if (code <= 1) return;
  for (const line of read("stderr").split("\n")) {
    if (line !== "") lines.say(`stderr: ${plain(line)}`);
  }
}

function transcribe(run, seen, comparison) {
  rmSync(seen, { recursive: true, force: true });
  mkdirSync(seen, { recursive: true });
  const write = (name, add) => {
    const lines = new Lines(comparison);
    add(lines);
    writeFileSync(join(seen, `${name}.txt`), lines.lines.map((line) => `${line}\n`).join(""));
  };
  write("ends", (lines) => addEnd(run, lines));
  if (!existsSync(run)) return;
  const files = readdirSync(run).sort();
  const read = (file) => (files.includes(file) ? readFileSync(join(run, file), "utf8") : "");
  const configuration = read("effective_config.yaml");
  write("files", (lines) => files.forEach((file) => lines.say(`file: ${file}`)));
  for (const file of files) {
    const [, name, extension] = /^(.*?)(?:\.([^.]*))?$/.exec(file);
    const transcribers = {
      csv: (lines) => addCsv(read(file), lines),
      db: (lines) => addDatabase(name, join(run, file), lines),
      html: (lines) => addPage(read(file), configuration, lines),
      json: (lines) => addJson(name, JSON.parse(read(file)), lines),
      sqlite: (lines) => addDatabase(name, join(run, file), lines),
      yaml: (lines) => configuration.trimEnd().split("\n").forEach((line) => lines.say(line)),
    };
    if (transcribers[extension]) write(name, transcribers[extension]);
  }
}

const [run, seen, comparison] = process.argv.slice(2);
transcribe(run, seen, comparison);
