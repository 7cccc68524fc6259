#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/log.hpp>
#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/session.hpp>

#include "inputs.hpp"
#include "new_robot.hpp"
#include "view_server.hpp"

namespace sidestep {

/// What a run says while it goes on, on stderr and in a log file: messages, and progress as one
/// line that is updated on a terminal, as a line every few seconds elsewhere. [any]
class Console final : public Log {
 public:
  Console();
  ~Console() override;

  void write(LogLevel level, std::string_view message) override;

  /// From now on, messages of every level are written to `file`, too; after what it holds where
  /// `append`.
  [[nodiscard]] Result<void> open_file(const std::filesystem::path& file, bool append);

  /// `total` 0 where it is not known; where it is, the time left is told from the pace since it
  /// became so.
  void progress(std::int64_t done, std::int64_t total, std::string_view what);
  /// Removes the progress line, so that other output may follow.
  void end_progress();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// How the command ends (docs/reference/command.md).
enum class ExitCode {
  kSuccess = 0,
  kTaskFailed = 1,
  kConfiguration = 2,
  kPlugin = 3,
  kFault = 4,
  kUndecided = 5,
};
/// Opens every library of the search path, before the command does what can be seen: one that ends
/// the process then is refused (supervise.hpp), and nothing is done twice. Those of a
/// configuration's own `plugin_paths` come later.
void open_plugins();
/// Of an error at run time.
[[nodiscard]] ExitCode exit_code(const Error& error) noexcept;
/// Of the mistakes in a configuration; not empty.
[[nodiscard]] ExitCode exit_code(const std::vector<Error>& errors) noexcept;
[[nodiscard]] ExitCode worse(ExitCode a, ExitCode b) noexcept;

/// Prints errors on stderr, one a line.
void print_errors(const std::vector<Error>& errors);
/// Prints an error that is the user's to mend.
[[nodiscard]] ExitCode wrong_input(const Error& error);

/// A configuration that was read and checked: a file, or a name in the installation's folder of
/// configurations, with or without .yaml.
struct CheckedConfiguration {
  Configuration configuration;
  RunSettings settings;
  std::unique_ptr<Session> session;  ///< Null where the file could not be read.
  std::vector<Error> errors;
};
[[nodiscard]] CheckedConfiguration load_configuration(const std::string& name,
                                                      const std::vector<std::string>& overrides,
                                                      Log& log);

/// While it lives, the first SIGINT or SIGTERM requests a stop; one that comes half a second later
/// or more ends the process as it would without us. To be made before other threads are, which
/// inherit the blocked signals.
class StopOnSignal {
 public:
  StopOnSignal();

  [[nodiscard]] std::stop_token token() const noexcept { return stop_.get_token(); }
  /// Until the stop is requested.
  void wait() const;

 private:
  std::stop_source stop_;
  std::jthread waiter_;
};

/// How the viewer is to be served.
struct ViewOptions {
  bool view = false;  ///< Of `run`: whether at all.
  unsigned short port = 0;
  std::optional<std::string> bind;  ///< An address; then a token is required.
  bool open = false;                ///< In a browser.
};

/// A file, readable by this user alone, that leads a browser to a URL with a token: command lines
/// are for all users to see.
class Doorway {
 public:
  /// In $XDG_RUNTIME_DIR, or else where temporary files are. Fails with kIo.
  [[nodiscard]] static Result<std::unique_ptr<Doorway>> make(const std::string& url);
  /// Removes the file.
  ~Doorway();
  Doorway(const Doorway&) = delete;
  Doorway& operator=(const Doorway&) = delete;

  [[nodiscard]] const std::string& file() const noexcept { return file_; }

 private:
  explicit Doorway(std::string file) : file_(std::move(file)) {}
  std::string file_;
};

struct ServedView {
  std::unique_ptr<ViewServer> server;
  std::unique_ptr<Doorway> doorway;  ///< Null where no browser was asked for, or no token is.
};

/// Serves the page with what comes through the server, or with a recording; prints its URL, and
/// opens it where that is asked for. With `desk`, the sphere editor's page instead. Fails as
/// ViewAssets::read() and ViewServer::start() do.
[[nodiscard]] Result<ServedView> serve_view(const ViewOptions& options, Log& log,
                                            RecordingOpener recording = {},
                                            PageRequestHandler* desk = nullptr);

/// The viewer of a command that runs experiments.
class LiveView {
 public:
  /// With a browser to be opened, waits until it has come, for a while.
  [[nodiscard]] static Result<std::unique_ptr<LiveView>> start(const ViewOptions& options,
                                                               const std::stop_token& stop);
  /// Sends what is left, for a second at most.
  ~LiveView();

  /// For the messages of the runs.
  [[nodiscard]] ViewSink& sink() noexcept { return *view_.server; }

 private:
  LiveView() = default;

  Console console_;
  ServedView view_;
};

struct RunOptions {
  std::vector<std::string> configurations;
  std::vector<std::string> overrides;  ///< "a.b=value"
  std::optional<std::filesystem::path> out;
  std::optional<std::string> shard;             ///< "i/n"
  std::optional<std::filesystem::path> resume;  ///< The folder of the run to go on with.
  int jobs = 1;                                 ///< Processes that share the work, a shard each.
  bool json = false;
  ViewOptions view;
  std::optional<std::filesystem::path> record;  ///< File that the one run is recorded into.
};
/// Runs each configuration; the worst of their exit codes.
[[nodiscard]] ExitCode run_command(const RunOptions& options);

/// Validates each configuration without running it.
[[nodiscard]] ExitCode check_command(const std::vector<std::string>& configurations,
                                     const std::vector<std::string>& overrides);

enum class PluginsFormat { kText, kJson, kMarkdown, kResults, kJsonSchema };

/// Lists the plugins that are there, or tells all about those of one name.
[[nodiscard]] ExitCode plugins_command(const std::optional<std::string>& name,
                                       PluginsFormat format);

struct SweepOptions {
  std::filesystem::path file;
  std::optional<std::filesystem::path> out;  ///< out/NAME of the file by default.
  int jobs = 1;                              ///< Runs at once.
  std::optional<int> task;                   ///< This one run alone, from 1.
  bool slurm = false;                        ///< A task of Slurm a run.
  std::vector<std::string> slurm_options;    ///< For sbatch.
};
/// Runs one configuration with all the values of a sweep (sweep.hpp), as far as they are not done,
/// and shows what they come to, side by side.
[[nodiscard]] ExitCode sweep_command(const SweepOptions& options);

struct NewPluginOptions {
  std::string kind;
  std::string name;
  std::optional<std::filesystem::path> out;  ///< A new folder; named like the plugin by default.
};
/// Writes a plugin to begin with, which builds and passes its tests: that kind's example, renamed.
[[nodiscard]] ExitCode new_plugin_command(const NewPluginOptions& options);

struct ValidateOptions {
  std::filesystem::path library;
  std::optional<std::filesystem::path> case_file;  ///< Its block, and what it promises.
  double timeout_s = 120.0;                        ///< Of one test.
};
/// Holds a built plugin to the suite of its kind, in other processes.
[[nodiscard]] ExitCode validate_command(const ValidateOptions& options);

/// Rebuilds the reports of finished runs, and compares several, or merges them into `merged` where
/// they are shards of one.
[[nodiscard]] ExitCode report_command(const std::vector<std::filesystem::path>& runs,
                                      const std::filesystem::path& comparison,
                                      const std::filesystem::path& merged);

/// Serves a recorded run in the viewer's page until a signal comes.
[[nodiscard]] ExitCode view_command(const std::filesystem::path& file, const ViewOptions& options);

struct RobotOptions {
  std::string profile;
  bool edit = false;  ///< In a browser.
  bool fit = false;
  double protrusion_m = 0.04;
  std::optional<int> spheres;                    ///< Instead: how many.
  bool write = false;                            ///< What was fitted, into the profile.
  std::optional<std::filesystem::path> out;      ///< Instead, into this new file.
  std::optional<std::filesystem::path> against;  ///< A URDF to hold the profile against.
  std::vector<std::string> package_paths;        ///< For that URDF's meshes.
  bool json = false;
  ViewOptions view;
  bool is_new = false;  ///< Instead of all that: makes a profile, as `new_profile` has it.
  NewRobotOptions new_profile;
};
/// Says what a robot profile has, fits spheres to it, serves the sphere editor until a signal
/// comes, holds the profile against a URDF, or makes one.
[[nodiscard]] ExitCode robot_command(const RobotOptions& options);

struct CertifyOptions {
  std::vector<std::filesystem::path> motions;
  MotionFormat format;
  RobotInput robot;
  std::vector<std::filesystem::path> scenes;
  std::optional<double> point_radius_m;  ///< Of the points of a cloud.
  double margin_m = 0.0;
  /// For the certificate of a motion that is proven; a folder for those of several.
  std::optional<std::filesystem::path> out;
  std::optional<int> threads;
  bool json = false;
};
/// Proves that a robot keeps apart from a scene on motions, or refutes it.
[[nodiscard]] ExitCode certify_command(const CertifyOptions& options);

}  // namespace sidestep
