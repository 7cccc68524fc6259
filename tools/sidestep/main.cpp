#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <iostream>
#include <map>
#include <new>
#include <system_error>

#include <CLI/CLI.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "commands.hpp"
#include "cover_fit.hpp"
#include "number_range.hpp"
#include "supervise.hpp"

namespace sidestep {
namespace {

constexpr const char* kConfigHelp =
    "Configuration: a file, or the name of an installed one, e.g. demo";

/// What the command line asks for.
struct CommandLine {
  RunOptions run;
  std::optional<std::uint64_t> seed;
  std::optional<int> threads;
  std::optional<std::string> plugin;
  bool markdown = false;
  bool results = false;
  bool json_schema = false;
  std::vector<std::filesystem::path> report_runs;
  std::filesystem::path comparison = "comparison.html";
  std::filesystem::path merged = "merged";
  std::filesystem::path recording;
  RobotOptions robot;
  CertifyOptions certify;
  SweepOptions sweep;
  NewPluginOptions new_plugin;
  ValidateOptions validate;
};

void add_configurations(CLI::App& command, CommandLine& line) {
  command.add_option("CONFIG", line.run.configurations, kConfigHelp)->required();
  // One value an occurrence, so that `CONFIG --set a=1 CONFIG` does not take CONFIG for a value.
  command
      .add_option("--set", line.run.overrides,
                  "Override a value of the configuration, e.g. mapper.resolution_m=0.05")
      ->type_name("KEY=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);  // after the policy, which allows them
}

void add_certify_command(CLI::App& app, CertifyOptions& certify) {
  CLI::App* command = app.add_subcommand(
      "certify", "Prove that a robot keeps apart from a scene on motions, whoever planned them");
  command
      ->add_option(
          "MOTION", certify.motions,
          "CSV (time_s and the joints, a line an instant), a trajectory of MoveIt as YAML, "
          ".npy of NumPy, .txt as OMPL prints a path, .bag of a recorded run")
      ->required();
  command->add_option("--robot", certify.robot.robot, "The robot's name, its profile, or its URDF")
      ->required();
  command
      ->add_option("--srdf", certify.robot.srdf,
                   "All links are held against each other but those that this SRDF disables")
      ->type_name("FILE");
  command
      ->add_option("--fixed", certify.robot.fixed,
                   "A joint that is not in the motions, and where it stays [m, rad]")
      ->type_name("JOINT=VALUE")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
  command
      ->add_option("--package-path", certify.robot.package_paths,
                   "A folder for package://NAME/... of a URDF, or NAME=FOLDER")
      ->type_name("FOLDER")
      ->allow_extra_args(false);
  command
      ->add_option(
          "--scene", certify.scenes,
          "A scene, or a planning scene of MoveIt, as YAML; .bt or .ot of OctoMap, a .pcd, "
          "the last map of a .bag; may be given several times")
      ->type_name("FILE")
      ->required()
      ->allow_extra_args(false);
  command->add_option("--point_radius_m", certify.point_radius_m, "Of the points of a .pcd")
      ->check(number_range(0.0, 10.0));
  command
      ->add_option("--joints", certify.format.joints, "Of the columns of .npy and .txt, in order")
      ->type_name("A,B,...")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option("--step_s", certify.format.step_s,
                   "Between the rows of .npy and .txt (default: waypoints without times)")
      ->check(number_range(1e-9, 1e6));
  command->add_option("--threads", certify.threads, "Default: all cores")
      ->check(CLI::Range(1, 1024));
  command
      ->add_option("--joined", certify.format.joining,
                   "What the robot does between two states (default: by what they hold)")
      ->transform(
          CLI::CheckedTransformer(std::map<std::string, Joining>{{"linear", Joining::kLinear},
                                                                 {"cubic", Joining::kCubic},
                                                                 {"quintic", Joining::kQuintic}})
              .description(""))
      ->type_name("linear|cubic|quintic");
  command->add_option("--margin_m", certify.margin_m, "How far apart all is to be, at least")
      ->check(number_range(0.0, 10.0))
      ->capture_default_str();
  command
      ->add_option(
          "--out", certify.out,
          "Write the certificate of a motion that is proven, for sidestep_recheck; of several "
          "motions into this folder")
      ->type_name("FILE");
  command->add_flag("--json", certify.json, "Print as JSON");
}

/// Of a command that serves the viewer.
void add_view_options(CLI::App& command, ViewOptions& view) {
  command.add_option("--view-port", view.port, "Port of the viewer (default: a free one)")
      ->type_name("N")
      ->check(CLI::Range(1, 65535));
  command
      .add_option("--view-bind", view.bind,
                  "Serve the viewer on this address, not only to this machine; the URL then holds "
                  "a token, without which nobody sees anything")
      ->type_name("ADDRESS");
  command.add_flag("--open", view.open, "Open the viewer in a browser");
}

void add_new_robot_command(CLI::App& robot, NewRobotOptions& options) {
  CLI::App* command = robot.add_subcommand(
      "new", "Make a profile of a URDF: spheres, pairs of links, poses, joints that are planned");
  command->add_option("URDF", options.urdf, "The robot's URDF, expanded where it is xacro")
      ->required();
  command->add_option("--out", options.out, "Folder for the profile; its name is the robot's")
      ->type_name("DIR")
      ->required();
  CLI::Option* const srdf =
      command
          ->add_option("--srdf", options.srdf,
                       "MoveIt's SRDF of it, for groups, poses and pairs that are not checked")
          ->type_name("FILE");
  command->add_option("--group", options.group, "Plan the joints of this group of the SRDF alone")
      ->type_name("NAME")
      ->needs(srdf);
  command
      ->add_option("--package-path", options.package_paths,
                   "A folder with the packages of its meshes, or NAME=DIR; may be repeated")
      ->type_name("DIR")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false);
  command
      ->add_option("--protrusion_m", options.protrusion_m,
                   "How far spheres may stand out from the shapes")
      ->type_name("M")
      ->check(number_range(FitGoal::kLeastProtrusion_m, FitGoal::kMostProtrusion_m))
      ->capture_default_str();
}

void add_robot_command(CLI::App& app, RobotOptions& robot) {
  CLI::App* command = app.add_subcommand(
      "robot",
      "Show a robot profile; fit or edit the spheres that cover its shapes; hold it against "
      "the robot's own URDF");
  command->add_option("PROFILE", robot.profile,
                      "The robot's name, its profile's folder or file, or a URDF");
  command->add_flag("--spheres", robot.edit, "Edit the spheres in a browser");
  add_view_options(*command, robot.view);
  for (const char* option : {"--view-port", "--view-bind", "--open"}) {
    command->get_option(option)->needs("--spheres");
  }
  command->add_flag("--fit", robot.fit, "Fit spheres to the shapes")->excludes("--spheres");
  CLI::Option* const protrusion =
      command
          ->add_option("--protrusion_m", robot.protrusion_m,
                       "How far fitted spheres may stand out from the shapes")
          ->type_name("M")
          ->needs("--fit")
          ->check(number_range(FitGoal::kLeastProtrusion_m, FitGoal::kMostProtrusion_m))
          ->capture_default_str();
  command
      ->add_option("--count", robot.spheres,
                   "Instead: as little excess volume as this many spheres come to")
      ->type_name("N")
      ->needs("--fit")
      ->excludes(protrusion)
      ->check(CLI::Range(1, FitGoal::kMostSpheres));
  CLI::Option* const write =
      command->add_flag("--write", robot.write, "Save the fitted spheres into the profile")
          ->needs("--fit");
  command
      ->add_option(
          "--out", robot.out,
          "Save fitted or edited spheres into this new file, a copy of the profile, instead")
      ->type_name("FILE")
      ->excludes(write);
  command->add_flag("--json", robot.json, "Print as JSON")->excludes("--spheres");
  CLI::Option* const against =
      command
          ->add_option("--against", robot.against,
                       "Say what of this URDF's collision shapes stands out of the profile")
          ->type_name("URDF");
  for (const char* option : {"--fit", "--spheres", "--out"}) {
    against->excludes(command->get_option(option));
  }
  command
      ->add_option("--package-path", robot.package_paths,
                   "A folder with the packages of that URDF's meshes, or NAME=DIR; may be repeated")
      ->type_name("DIR")
      ->expected(1)
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
      ->allow_extra_args(false)
      ->needs(against);
}

void add_run(CLI::App& app, CommandLine& line) {
  CLI::App* run = app.add_subcommand("run", "Run experiments");
  add_configurations(*run, line);
  run->add_option("--out", line.run.out,
                  "Folder for the results; files of an earlier run in it "
                  "are replaced (default: out/CONFIG-TIME)")
      ->type_name("DIR");
  run->add_option("--shard", line.run.shard,
                  "Do part i of n of the work, e.g. 1/4; `sidestep report` merges the parts")
      ->type_name("i/n");
  run->add_option("--jobs", line.run.jobs,
                  "Do the work in n processes at once, a shard each, and merge the parts")
      ->type_name("N")
      ->check(CLI::Range(1, 1024))
      ->excludes("--shard");
  run->add_option("--resume", line.run.resume,
                  "Go on with the run in this folder where it ended, with the same configuration")
      ->type_name("DIR")
      ->excludes("--out");
  run->add_option("--seed", line.seed, "Seed; same as --set experiment.seed=N")->type_name("N");
  run->add_option("--threads", line.threads, "Threads; same as --set experiment.threads=N")
      ->type_name("N");
  run->add_flag("--json", line.run.json, "Print the summary, and nothing else, on stdout");
  run->add_flag("--view", line.run.view.view, "Show the run in a browser while it goes on")
      ->excludes("--jobs");
  add_view_options(*run, line.run.view);
  for (const char* option : {"--view-port", "--view-bind", "--open"}) {
    run->get_option(option)->needs("--view");
  }
  run->add_option(
         "--record", line.run.record,
         "Record the run into this new file, as a bag of ROS 1 (docs/reference/recording.md)")
      ->type_name("FILE")
      ->excludes("--jobs");
}

void add_sweep(CLI::App& app, SweepOptions& sweep) {
  CLI::App* command =
      app.add_subcommand("sweep", "Run a configuration with all the values of a sweep");
  command->add_option("FILE", sweep.file, "The sweep (docs/reference/command.md)")->required();
  command
      ->add_option("--out", sweep.out,
                   "Folder for the runs (default: out/NAME); what is done there is not done again")
      ->type_name("DIR");
  command->add_option("--jobs", sweep.jobs, "Runs at once, each in a process of its own")
      ->type_name("N")
      ->check(CLI::Range(1, 1024));
  command->add_option("--task", sweep.task, "Do this one run alone, counted from 1")
      ->type_name("I")
      ->check(CLI::Range(1, 1000000))
      ->excludes("--jobs");
  CLI::Option* const slurm =
      command->add_flag("--slurm", sweep.slurm, "Have Slurm do them, as one job array")
          ->excludes("--jobs", "--task");
  command
      ->add_option("--slurm-option", sweep.slurm_options,
                   "For sbatch, e.g. --slurm-option=--partition=long; may be repeated")
      ->type_name("OPTION")
      ->allow_extra_args(false)
      ->needs(slurm);
}

void add_commands(CLI::App& app, CommandLine& line) {
  app.set_version_flag("--version", [] {
    const RunProvenance build = current_provenance();
    return "sidestep " + build.version + " (" + build.git_hash + ")";
  });
  app.require_subcommand(0, 1);

  add_run(app, line);
  add_sweep(app, line.sweep);

  CLI::App* view = app.add_subcommand("view", "Show a recorded run in a browser");
  view->add_option("FILE", line.recording, "What `sidestep run --record` wrote")->required();
  add_view_options(*view, line.run.view);

  add_robot_command(app, line.robot);
  add_new_robot_command(*app.get_subcommand("robot"), line.robot.new_profile);
  add_certify_command(app, line.certify);

  CLI::App* check = app.add_subcommand("check", "Validate configurations without running them");
  add_configurations(*check, line);

  CLI::App* plugins = app.add_subcommand("plugins", "List the plugins, or one plugin's parameters");
  plugins->add_option("NAME", line.plugin, "Name of a plugin");
  plugins->add_flag("--json", line.run.json, "Print as JSON");
  plugins->add_flag("--markdown", line.markdown, "Print the reference page")->excludes("--json");
  plugins->add_flag("--schema", line.json_schema, "Print a JSON Schema of configurations")
      ->excludes("--json", "--markdown");
  plugins->add_flag("--results", line.results, "Print the reference page of results")
      ->excludes("--json", "--markdown", "--schema");

  CLI::App* new_plugin = app.add_subcommand(
      "new", "Write a plugin of your own to begin with: sources, test, CMakeLists.txt");
  new_plugin->add_option("KIND", line.new_plugin.kind, "Kind of plugin, e.g. mapper")->required();
  new_plugin->add_option("NAME", line.new_plugin.name, "Its name, e.g. my_mapper")->required();
  new_plugin->add_option("--out", line.new_plugin.out, "New folder for it (default: NAME)")
      ->type_name("DIR");

  CLI::App* validate =
      app.add_subcommand("validate", "Hold a built plugin to the suite of its kind");
  validate->add_option("LIBRARY", line.validate.library, "The plugin's shared library")->required();
  validate->add_option("CASE", line.validate.case_file,
                       "Its block, and what it promises (docs/tutorials/write_a_plugin.md)");
  validate->add_option("--timeout_s", line.validate.timeout_s, "For each test")
      ->check(number_range(0.1, 86400.0))
      ->capture_default_str();

  CLI::App* report = app.add_subcommand(
      "report", "Rebuild the reports of runs from their results; compare several; merge shards");
  report->add_option("DIR", line.report_runs, "Folder that a run wrote to")->required();
  report->add_option("--comparison", line.comparison, "Page that compares several runs")
      ->type_name("FILE")
      ->capture_default_str();
  report->add_option("--merged", line.merged, "Folder for the whole that several shards make up")
      ->type_name("DIR")
      ->capture_default_str();
}

ExitCode dispatch(const CLI::App& app, CommandLine& line) {
  if (line.seed) line.run.overrides.push_back("experiment.seed=" + std::to_string(*line.seed));
  if (line.threads) {
    line.run.overrides.push_back("experiment.threads=" + std::to_string(*line.threads));
  }
  if (app.got_subcommand("run")) return run_command(line.run);
  if (app.got_subcommand("check")) {
    return check_command(line.run.configurations, line.run.overrides);
  }
  if (app.got_subcommand("plugins")) {
    return plugins_command(line.plugin, line.results       ? PluginsFormat::kResults
                                        : line.markdown    ? PluginsFormat::kMarkdown
                                        : line.json_schema ? PluginsFormat::kJsonSchema
                                        : line.run.json    ? PluginsFormat::kJson
                                                           : PluginsFormat::kText);
  }
  if (app.got_subcommand("report")) {
    return report_command(line.report_runs, line.comparison, line.merged);
  }
  if (app.got_subcommand("robot")) {
    line.robot.is_new = app.get_subcommand("robot")->got_subcommand("new");
    return robot_command(line.robot);
  }
  if (app.got_subcommand("certify")) return certify_command(line.certify);
  if (app.got_subcommand("sweep")) return sweep_command(line.sweep);
  if (app.got_subcommand("new")) return new_plugin_command(line.new_plugin);
  if (app.got_subcommand("validate")) return validate_command(line.validate);
  if (app.got_subcommand("view")) return view_command(line.recording, line.run.view);
  std::printf("%s", app.help().c_str());
  return ExitCode::kSuccess;
}

int command(int argc, char** argv) {
  CLI::App app("Scene reconstruction and whole-body motion planning", "sidestep");
  CommandLine line;
  add_commands(app, line);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version are "errors" of code 0; every other is a mistake in usage.
    return app.exit(error) == 0 ? 0 : static_cast<int>(ExitCode::kConfiguration);
  }
  return static_cast<int>(dispatch(app, line));
}

/// Opens the standard streams that are closed: no file of a run may get their numbers.
void open_standard_streams() {
  int file = 0;
  while (file >= 0 && file <= STDERR_FILENO) file = open("/dev/null", O_RDWR);
  if (file >= 0) close(file);
}

/// The exit code of a command that ends with `code`, once what it printed is out.
int code_after_output(int code) {
  std::cout.flush();
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return code;
  std::fprintf(stderr, "error: cannot write to stdout: %s\n", std::strerror(errno));
  return static_cast<int>(ExitCode::kFault);
}

/// The exit code of the exception that is being handled, once it is told.
int tell_exception() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    std::fputs("error: out of memory\n", stderr);
  } catch (const std::system_error& error) {
    const bool lacks_thread = error.code() == std::errc::resource_unavailable_try_again;
    std::fprintf(stderr, "error: %s%s\n", lacks_thread ? "cannot start a thread: " : "",
                 error.what());
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "error: a fault in Sidestep: %s\n", exception.what());
  }
  return static_cast<int>(ExitCode::kFault);
}

}  // namespace
}  // namespace sidestep

int main(int argc, char** argv) {
  sidestep::open_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // A file that may not grow is an error of write().
  const auto command = [](int count, char** words) {
    try {
      return sidestep::code_after_output(sidestep::command(count, words));
    } catch (...) {
      return sidestep::tell_exception();
    }
  };
  try {
    return sidestep::supervise(command, argc, argv);
  } catch (...) {
    return sidestep::tell_exception();
  }
}
