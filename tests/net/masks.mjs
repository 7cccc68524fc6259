// What may differ between two runs of one build, by its address (transcribe.mjs says what addresses look
// like). What is masked still has to be there, and null where it was null. Nothing else may differ.
export const masks = [
  {
    pattern: /(?<!peer\.)(?<!peer_)\b(frame|read|integrate|field|publish|solve|search|check|retime|latency|time|first|spent|first_valid|stages)_ms\b|(?<!peer\.)\blm_iteration_us\b/,
    as: "time",
    why: "Wall times. Other keys in ms are times of the simulation's clock, or were recorded by somebody.",
  },
  {
    pattern: /\b(wall_s|cpu_s|time\.(solve|check|field)_s)$|\.(totaltime|time|first_solution_time)$/,
    as: "time",
    why: "Sums of wall or CPU time; wall times in seconds of OMPL's schema",
  },
  {
    pattern: /: (frame|frame time|solve|check|iteration|latency|time|first|integrate|field|publish|all searches) (p50|p95|max|mean|sd)$|: solve$/,
    as: "time",
    why: "Wall times in columns of tables, on stdout and on the page",
  },
  {
    pattern: /: (first|second|third|fourth)$/,
    as: "time",
    why: "The same by quarter of a mapping benchmark, with its memory",
  },
  {
    pattern: /: (wall|of all cores|in the optimiser, all threads|in the check|making fields)$|solve p50: this run$/,
    as: "time",
    why: "The same in tables of a field study and of a closed loop",
  },
  {
    pattern: /\barrays episode \d+ mapping \.float32 [34]$|\banswers \.float32 0$/,
    as: "time",
    why: "Wall times in arrays: integrate_ms and field_ms; when a planner had an answer",
  },
  {
    pattern: /\b(time_ratio|ratio)\.(p50|p95|mean|of_means)$|: (ratio|of afresh's.*)$/,
    as: "ratio of times",
    why: "Quotients of wall times",
  },
  {
    pattern: /\breal_time\.rate_hz$/,
    as: "rate",
    why: "Frames over the time from the first frame to the last update's end",
  },
  {
    pattern: /\bmeasurements real_time \d+ duration_s$/,
    as: "time",
    why: "The same time of a mapping benchmark",
  },
  {
    pattern: /\b(memory|resident)_mib$|: memory$/,
    as: "memory",
    why: "What the allocator has asked of the system, pages of libraries included",
  },
  {
    pattern: /\b(version|git_hash|build_flags|cpu|cpuinfo|hostname)$|: commit$/,
    as: "build",
    why: "Names this build and this machine",
  },
  { pattern: /\.date$/, as: "date", why: "When the run was" },
];

export const textMasks = [
  { pattern: /takes \d+\.\d ms/g, as: "takes (time) ms", why: "A verdict's wall time" },
  { pattern: /in \d+\.\d+ of the time/g, as: "in (ratio) of the time", why: "A verdict's quotient of wall times" },
];

/// What a comparison leaves out, by its name.
const leftOut = {
  // Of a whole and of what it was put together from.
  sessions: [
    /^results measurements session /,  // each stretch of work with the problems solved in it
    /^summary\.time\.sessions /,  // their number
    /^stdout: .*report\.html$/,  // where `report` names the shards' pages, and `run` names one
    /^file: (run\.log|shard-\d+)$/,  // `report` keeps no log; --jobs leaves its shards in the folder
  ],
};

export function isLeftOut(line, comparison) {
  return (leftOut[comparison] ?? []).some((pattern) => pattern.test(line));
}
