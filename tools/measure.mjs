// Measures the tables of docs/performance.md and writes them into the page. Called by tools/measure.sh, which says how.
//
// Each table lies between two comments of the page that name its area. An area is measured by `sidestep run`, of whose
// summary.json it shows values, or by benchmarks, of which it shows times.
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { cpus } from "node:os";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";

const root = dirname(dirname(fileURLToPath(import.meta.url)));
const bin = join(root, "build/release/bin");
const work = join(root, "build/measure");
const data = process.env.SIDESTEP_SHARED_DATA ?? join(root, "../shared/data");
const kitchen = join(data, "kinect_kitchen");

/// Recorded inputs that are not there: the area that needs them keeps the table it has.
class Missing extends Error {}

function need(path) {
  if (!existsSync(path)) throw new Missing(`needs ${path}`);
  return path;
}

function call(program, args) {
  console.error(`  ${program} ${args.join(" ")}`);
  try {
    execFileSync(join(bin, program), args, { cwd: root, stdio: ["ignore", "ignore", "pipe"] });
  } catch (error) {
    if (error.status !== 1) throw new Error(`${program}: ${error.stderr}`);  // 1: the verdict is no success
  }
}

/// summary.json of a run.
function run(config, ...settings) {
  const out = join(work, "run");
  rmSync(out, { recursive: true, force: true });
  call("sidestep", ["run", config, "--out", out, ...settings.flatMap((setting) => ["--set", setting])]);
  return JSON.parse(readFileSync(join(out, "summary.json"), "utf8"));
}

/// Times of a benchmark program by name, in the unit that it prints, and its counters: the median of three repetitions.
function bench(program, filter) {
  const out = join(work, "benchmark.json");
  call(program, [`--benchmark_filter=${filter}`, `--benchmark_out=${out}`, "--benchmark_min_time=0.3",
    "--benchmark_repetitions=3", "--benchmark_report_aggregates_only=true"]);
  const found = JSON.parse(readFileSync(out, "utf8")).benchmarks.filter((one) => one.aggregate_name === "median");
  if (found.length === 0) throw new Missing(`${program}: no benchmark ran of ${filter}`);
  return Object.fromEntries(found.map((one) => [one.run_name, one]));
}

const number = (value) =>
  value === null || value === undefined ? "-" : String(Number(Number(value).toPrecision(Math.abs(value) >= 100 ? 3 : 2)));
const ms = (value) => `${number(value)} ms`;
const share = (value) => (value === null || value === undefined ? "-" : `${(100 * value).toFixed(1)} %`);
const time = (one) => `${number(one.real_time)} ${one.time_unit}`;
const spread = (times) => ["p50", "p95", "max"].map((key) => number(times[key])).join(" / ") + " ms";

function table(header, rows) {
  const line = (cells) => `| ${cells.join(" | ")} |`;
  return [line(header), line(header.map(() => "---")), ...rows.map(line)].join("\n");
}

/// One row a benchmark: its name, without how it is timed, and its time.
function times(program, filter) {
  return Object.entries(bench(program, filter)).map(([name, one]) => [`\`${name.replace(/\/(process_time|real_time|iterations:\d+)/g, "")}\``, time(one)]);
}

function plans(config, ...settings) {
  const { map, plans } = run(config, ...settings);
  const name = [`\`${config.replace("configs/", "").replace(".yaml", "")}\``,
    ...settings.filter((one) => one.startsWith("optimiser")).map((one) => `\`${one.split("=")[1]}\``)].join(", ");
  return plans.map((plan) => [name, spread(map.frame_ms), ms(plan.solve_ms), plan.iterations,
    plan.success ? `${plan.min_clearance_m.toFixed(3)} m` : plan.reason]);
}

function systems(...settings) {
  const { systems } = run("configs/paper/table2.yaml", "experiment.clock=both", ...settings);
  return systems.map((one) => [one.name, one.signed ? "signed" : "unsigned", `${100 * one.resolution_m} cm`,
    `${ms(one.frame_ms.mean)}`, ms(one.frame_ms.p95), number(one.ratio?.mean),
    one.max_error_m === undefined || one.max_error_m === null ? "-" : `${one.max_error_m.toFixed(3)} m`,
    share(one.truth?.collision_recall), share(one.real_time?.dropped_share), `${number(one.real_time?.rate_hz)} Hz`]);
}

function recorded(file, optimiser, ...set) {
  const { runs } = run("configs/peers/gpmp2.yaml", `experiment.problems=${need(join(data, "gpmp2", file))}`,
    `optimiser.plugin=${optimiser}`, ...set);
  return runs.map((one) => [file.replace("problems_", "").replace(".json", ""), one.label, one.field,
    `\`${optimiser}\``, ms(one.solve_ms.p50), ms(one.solve_ms.p95), ms(one.peer.solve_ms.p50),
    share(one.cost.share_within_1pct), `${share(one.free_ends.share)} (${share(one.free_ends.peer_share)})`]);
}

function planners(robot) {
  const summary = run(`configs/peers/mbm_${robot}.yaml`, `experiment.problems=${need(join(data, "mbm", robot))}`,
    "experiment.every=20");
  return summary.planners.filter((one) => one.family === "all").map((one) => [robot, one.name, one.answers,
    share(one.solved_share.s1), share(one.solved_share.s5), ms(one.first_valid_ms.p50), ms(one.first_valid_ms.p95),
    ms(one.time_ms.p50), number(one.path_length_rad.p50), one.refused_by_check]);
}

function loop(config, episodes) {
  const one = run(config, `experiment.episodes=${episodes}`);
  return [[`\`${config.replace("configs/", "").replace(".yaml", "")}\``, one.episodes, share(one.success_share),
    one.collisions_true, `${number(one.min_true_clearance_m)} m`, spread(one.search_ms), spread(one.stamp_to_trajectory_ms),
    `${number(one.step_hz)} Hz`]];
}

const scenarios = ["room_navigation", "table_pickup", "shelf_pickup", "floor_pickup", "arm_reach"];

const areas = {
  plans: () => table(["configuration", "frame p50 / p95 / max", "solve", "iterations", "clearance in every check"], [
    ...plans("configs/demo.yaml"), ...plans("configs/demo.yaml", "optimiser.plugin=gp_ceres"),
    ...plans("configs/kitchen_hsr_gp.yaml", `source.path=${need(kitchen)}`),
    ...plans("configs/kitchen_hsr_gp.yaml", `source.path=${kitchen}`, "optimiser.plugin=gp_ceres"),
    ...plans("configs/kitchen_hsr_ompl.yaml", `source.path=${kitchen}`)]),

  stages: () => table(["benchmark", "time"], [
    ...times("voxel_grid_benchmark", "."), ...times("edt_benchmark", "^kitchen/")]),

  systems: () => table(["system", "field", "voxel", "mean", "p95", "ratio", "largest error", "recall", "dropped", "rate"],
    systems("experiment.frames=100")),

  fields: () => table(["benchmark", "time"], [
    ...times("edt_benchmark", "^(full_|first|small_|query)"), ...times("dynamic_edt_benchmark", ".")]),

  recorded: () => table(["problems", "rules", "field", "optimiser", "p50", "p95", "GPMP2 p50", "within 1 % of its cost",
    "free where ends are (GPMP2)"], [
    ...recorded("problems_panda_single.json", "gp_chain"), ...recorded("problems_panda_clutter.json", "gp_chain"),
    ...recorded("problems_hsr_single.json", "gp_chain", "optimiser.base_prior=body"),
    ...recorded("problems_hsr_clutter.json", "gp_chain", "optimiser.base_prior=body"),
    ...recorded("problems_panda_clutter.json", "gp_ceres")]),

  planners: () => table(["robot", "planner", "problems", "within 1 s", "within 5 s", "first answer p50", "p95",
    "smooth answer p50", "path p50, rad", "refused by the check"], [...planners("panda"), ...planners("fetch")]),

  loops: () => table(["configuration", "episodes", "success", "collisions", "least clearance", "search p50 / p95 / max",
    "stamp to trajectory p50 / p95 / max", "steps"], [
    ...scenarios.flatMap((name) => loop(`configs/replan/${name}.yaml`, 5)),
    ...scenarios.flatMap((name) => loop(`configs/live/${name}.yaml`, 1))]),

  kernels: () => table(["benchmark", "time"], [
    ...times("kinematics_benchmark", "."), ...times("gp_chain_benchmark", "^(query|linearise|solve_chain)"),
    ...times("ompl_benchmark", "check|edges"), ...times("geometry_benchmark", "."), ...times("viewer_benchmark", ".")]),
};

const asked = process.argv.slice(2);
for (const area of asked) {
  if (!(area in areas)) {
    console.error(`measure.sh: there is no area '${area}'; there are: ${Object.keys(areas).join(", ")}`);
    process.exit(2);
  }
}
const commit = execFileSync("git", ["describe", "--always", "--dirty"], { cwd: root, encoding: "utf8" }).trim();
const machine = `${cpus().length} cores, ${cpus()[0].model.trim()}; commit ${commit}`;
const page = join(root, "docs/performance.md");
mkdirSync(work, { recursive: true });
let failed = 0;
for (const area of asked.length > 0 ? asked : Object.keys(areas)) {
  console.error(area);
  const [begin, end] = [`<!-- measured: ${area} -->`, `<!-- end: ${area} -->`];
  try {
    const measured = areas[area]();
    const text = readFileSync(page, "utf8");
    const [from, to] = [text.indexOf(begin), text.indexOf(end)];
    if (from < 0 || to < from) throw new Error(`docs/performance.md lacks ${begin} and ${end}`);
    writeFileSync(page, `${text.slice(0, from + begin.length)}\n${measured}\n\n${machine}.\n${text.slice(to)}`);
  } catch (error) {
    console.error(`  ${error instanceof Missing ? "left as it is" : "failed"}: ${error.message}`);
    if (!(error instanceof Missing)) failed = 1;
  }
}
process.exit(failed);
