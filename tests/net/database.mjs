// Databases: the schema, then every row of every table. A value's address is "FILE TABLE KEY... .COLUMN",
// without the column where there is but one beside the primary key.
import { execFileSync } from "node:child_process";
import { maskOf, plain, roundedOfArray, shown } from "./lines.mjs";

// Of a series of more items than these, several share a line.
const kMostItems = 12;
const kPerLine = 10;
// Of an array of more rows or columns than these, figures are written down.
const kMostRows = 64;
const kMostColumns = 12;

function sqlite(file, ...input) {
  return execFileSync("sqlite3", ["-readonly", ...input.slice(1), file, input[0]], { maxBuffer: 1 << 28 })
    .toString();
}

const rowsOf = (file, sql) => JSON.parse(sqlite(file, sql, "-json") || "[]");
const quoted = (name) => `"${name.replaceAll('"', '""')}"`;

/// Figures that change with any of the values, and with their order.
function figuresOf(values) {
  const finite = values.filter(Number.isFinite);
  const mean = (of) => of.reduce((sum, value) => sum + value, 0) / of.length;
  const figures = finite.length === 0 ? [] : [
    `mean ${roundedOfArray(mean(finite))}`,
    `rms ${roundedOfArray(Math.sqrt(mean(finite.map((value) => value * value))))}`,
    `by place ${roundedOfArray(2 * mean(finite.map((value, i) => (value * (i + 1)) / (finite.length + 1))))}`,
  ];
  if (finite.length < values.length) figures.push(`not finite ${values.length - finite.length}`);
  return figures.join(", ");
}

/// 32-bit floats, row by row, column by column.
function addArray(address, hex, columns, lines) {
  const bytes = Buffer.from(hex, "hex");
  const values = Array.from({ length: bytes.length / 4 }, (_, i) => bytes.readFloatLE(4 * i));
  const add = (where, of) => {
    if (of.length === 0) return;
    const text = of.length > kMostRows ? figuresOf(of) : of.map(roundedOfArray).join(" ");
    lines.say(`${where} = ${maskOf(where) ?? text}`);
  };
  if (columns > kMostColumns) return add(address, values);
  for (let c = 0; c < columns; ++c) add(`${address} ${c}`, values.filter((_, i) => i % columns === c));
}

/// "ADDRESS FIRST to LAST = VALUE...", kPerLine values a line.
function addSeries(address, items, values, lines) {
  for (let i = 0; i < values.length; i += kPerLine) {
    const texts = values.slice(i, i + kPerLine).map((value) => shown(address, value));
    const isMasked = texts.every((text) => text === texts[0] && text.startsWith("("));
    const last = Math.min(i + kPerLine, values.length) - 1;
    lines.say(`${address} ${items[i]} to ${items[last]} = ` +
      (isMasked ? `${texts.length} ${texts[0]}` : texts.join(" ")));
  }
}

const keyOf = (row, columns) => columns.map((column) => plain(String(row[column]))).join(" ");

/// Rows of one value each: a line a row or, of what has a long series in it, series by series.
function addValues(name, keys, value, rows, lines) {
  const item = keys.includes("item") ? "item" : keys.at(-1);
  const series = new Map();
  for (const row of rows) {
    const its = keyOf(row, keys.filter((key) => key !== item));
    if (!series.has(its)) series.set(its, []);
    series.get(its).push(row);
  }
  const long = new Set([...series.values()].filter((of) => of.length > kMostItems).map((of) => of[0][keys[0]]));
  for (const row of rows) {
    if (!long.has(row[keys[0]])) lines.add(`${name} ${keyOf(row, keys)}`, row[value]);
  }
  for (const [its, of] of series) {
    if (!long.has(of[0][keys[0]])) continue;
    addSeries(`${name} ${its}`, of.map((row) => row[item]), of.map((row) => row[value]), lines);
  }
}

function addTable(name, file, table, lines) {
  const columns = rowsOf(file, `SELECT name, pk FROM pragma_table_info(${quoted(table)})`);
  const keys = columns.filter(({ pk }) => pk > 0).sort((a, b) => a.pk - b.pk).map((column) => column.name);
  const others = columns.map((column) => column.name).filter((column) => !keys.includes(column));
  const chosen = columns.map(({ name: column }) => {
    const c = quoted(column);
    return `CASE typeof(${c}) WHEN 'blob' THEN hex(${c}) ELSE ${c} END AS ${c}, ` +
      `typeof(${c}) = 'blob' AS ${quoted(`${column} is a blob`)}`;
  });
  const order = keys.length > 0 ? keys.map(quoted).join(", ") : "rowid";
  const rows = rowsOf(file, `SELECT ${chosen.join(", ")} FROM ${quoted(table)} ORDER BY ${order}`);
  const isBlob = (row, column) => row[`${column} is a blob`] === 1;
  if (keys.length > 1 && others.length === 1 && !rows.some((row) => isBlob(row, others[0]))) {
    return addValues(`${name} ${table}`, keys, others[0], rows, lines);
  }
  rows.forEach((row, r) => {
    const key = keys.length > 0 ? keyOf(row, keys) : r;
    for (const column of others) {
      const address = `${name} ${table} ${key}` + (others.length > 1 ? ` .${column}` : "");
      if (isBlob(row, column)) {
        addArray(address, row[column], row.columns ?? 1, lines);
      } else {
        lines.add(address, row[column]);
      }
    }
  });
}

export function addDatabase(name, file, lines) {
  for (const line of sqlite(file, ".schema").trimEnd().split("\n")) lines.say(`schema: ${line.trim()}`);
  const tables = rowsOf(file, "SELECT name FROM sqlite_master " +
    "WHERE type = 'table' AND name NOT LIKE 'sqlite_%' ORDER BY name");
  for (const { name: table } of tables) addTable(name, file, table, lines);
}
