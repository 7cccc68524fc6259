// Tables and pages. A cell's address is "FILE FIRST CELL OF ITS ROW: COLUMN".
import { plain, shownCell } from "./lines.mjs";

/// Names that say what is in a column: "p95" after "solve p50" is "solve p95". Names that are there twice
/// are told apart by #2.
function fullNames(header) {
  const seen = {};
  let of = "";
  return header.map((name) => {
    const isFigure = /^(p05|p50|p95|max|mean|mean ± sd|sd|of means)$/.test(name);
    if (!isFigure) of = name.replace(/,? (p05|p50|p95|max|mean|sd)\b.*/, "");
    const full = isFigure ? `${of} ${name}` : name;
    seen[full] = (seen[full] ?? 0) + 1;
    return seen[full] > 1 ? `${full}#${seen[full]}` : full;
  });
}

function addTable(file, header, rows, lines) {
  const names = fullNames(header);
  lines.say(`${file} table: ${header.join(" | ")}`);
  for (const row of rows) {
    const cells = row.map((cell, c) => shownCell(`${file} ${row[0]}: ${names[c] ?? ""}`, cell));
    lines.say(`  ${cells.join(" | ")}`);
  }
}

/// Cells of a row on the terminal: the first is flush left, the others end where their columns' names end.
function cellsOf(row, ends) {
  const characters = Array.from(row);
  const between = (begin, end) => characters.slice(begin, end).join("");
  if (ends.length === 1) return [row.trim()];
  const [, first, second] = /^(.*?)(?:\s{2,}(\S.*))?$/.exec(between(0, ends[1]).trimEnd());
  const others = ends.slice(2).map((end, i) => between(ends[i + 1], end).trim());
  return [first, second ?? "", ...others];
}

/// What a command says: tables, which have a rule below their header, and sentences.
export function addTerminal(text, lines) {
  const all = text.split("\n");
  for (let i = 0; i < all.length; ++i) {
    const header = all[i];
    if (!/^-{5,}$/.test(all[i + 1] ?? "")) {
      if (header !== "") lines.say(`stdout: ${plain(header)}`);
      continue;
    }
    const names = [...header.matchAll(/\S+(?: \S+)*/gu)];
    const ends = names.map((name) => Array.from(header.slice(0, name.index + name[0].length)).length);
    const rows = [];
    for (i += 2; all[i]; ++i) rows.push(cellsOf(all[i], ends));
    addTable("stdout", names.map((name) => name[0]), rows, lines);
  }
}

function textOf(html) {
  const characters = { lt: "<", gt: ">", quot: '"', amp: "&" };
  return html.replace(/<[^>]*>/g, "").replace(/&(lt|gt|quot|amp);/g, (_, name) => characters[name]);
}

/// A page: headings, sentences, captions and tables. The configuration stands in a file of its own.
export function addPage(html, configuration, lines) {
  const blocks = /<(title|h1|h2|h3|p|summary|figcaption|pre|table)\b[^>]*>([\s\S]*?)<\/\1>/g;
  for (const [, tag, inner] of html.matchAll(blocks)) {
    if (tag !== "table") {
      const text = textOf(inner);
      const known = configuration !== "" && text.trim() === configuration.trim();
      for (const line of known ? ["effective_config.yaml"] : text.split("\n")) {
        if (line !== "") lines.say(`${tag}: ${plain(line)}`);
      }
      continue;
    }
    const rows = [...inner.matchAll(/<tr>([\s\S]*?)<\/tr>/g)].map(([, row]) =>
      [...row.matchAll(/<(th|td)\b[^>]*>([\s\S]*?)<\/\1>/g)].map(([, , cell]) => textOf(cell)));
    if (inner.includes("<th")) {
      addTable("report", rows[0], rows.slice(1), lines);
    } else {
      for (const [key, value] of rows) lines.add(`report ${key}`, value);
    }
  }
}
