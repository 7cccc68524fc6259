#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/session.hpp>

#include "conformance/test_host.hpp"

namespace sidestep::validate {

/// What a plugin promises beyond its interface: the block `expect` of a case file.
struct Expectations {
  double max_error_m = 0.0;
  bool unknown_is_occupied = false;
  bool takes_clouds = true;
  bool minimises_cost = true;
  bool repeatable = true;
  bool moves_freely = true;
  bool is_live = false;
  double truth_error_m = 0.02;
  double tracking_error = 1e-3;
  double delay_s = 0.0;
  double braking_share = 1.0;

  /// Those that plugins of a kind have.
  static Parameters<Expectations> parameters(PluginKind kind);
};

/// The built plugin that is held to the suite of its kind, as its case file describes it. [main]
class Subject {
 public:
  /// Opens the library and holds the case against the plugin. `case_file`: empty for a plugin as it
  /// is by default. Fails with kPlugin where the host refuses the library, with kConfig where the
  /// case does not fit.
  [[nodiscard]] static Result<std::unique_ptr<Subject>> open(
      const std::filesystem::path& library, const std::filesystem::path& case_file);

  [[nodiscard]] const PluginInfo& info() const noexcept { return info_; }
  [[nodiscard]] const Expectations& expect() const noexcept { return expect_; }
  /// The plugin's own.
  [[nodiscard]] const Node& block() const noexcept { return block_; }
  /// The whole case; for an experiment, a configuration.
  [[nodiscard]] const Configuration& configuration() const noexcept { return case_; }
  /// Finds the library before all others.
  [[nodiscard]] Host& host() { return host_with(nullptr); }
  [[nodiscard]] const DocumentReader& documents() const noexcept { return documents_; }
  /// That of the case, or else a planar arm of three joints on a base that slides.
  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const noexcept { return robot_; }

  /// A new object that works with `workers`, which outlive it and what `loan` points to; null: with
  /// two threads. Throws std::runtime_error where the plugin makes none, by which the test fails.
  template <class Interface>
  [[nodiscard]] std::shared_ptr<Interface> make(const RunLoan& loan = {},
                                                WorkerPool* workers = nullptr) {
    auto made = host_with(workers).create<Interface>(block_, loan);
    if (!made) throw std::runtime_error(made.error().describe());
    return std::shared_ptr<Interface>(std::move(*made));
  }

 private:
  explicit Subject(const std::filesystem::path& library);

  [[nodiscard]] Host& host_with(WorkerPool* workers);
  /// Of several plugins, the one that the case is of.
  [[nodiscard]] Result<void> find(const std::filesystem::path& library,
                                  const std::filesystem::path& case_file);
  [[nodiscard]] bool is_of(const PluginInfo& plugin, const std::filesystem::path& case_file) const;
  [[nodiscard]] Result<void> read_case(const std::filesystem::path& file);

  conformance::RecordingLog log_;
  SteadyWallClock clock_;
  YamlDocumentReader documents_;
  WorkerPool workers_;
  HostSettings settings_;
  std::map<WorkerPool*, std::unique_ptr<Host>> hosts_;  ///< By the threads that they lend.
  PluginInfo info_;
  Node block_;
  Configuration case_;
  Expectations expect_;
  std::shared_ptr<const RobotModel> robot_;
};

/// That of this process, from its opening on; null before.
[[nodiscard]] std::unique_ptr<Subject>& subject();

/// The parameters of a suite: the one that `make_case` returns, where the subject is of that kind.
template <class Make>
[[nodiscard]] auto cases_of(PluginKind kind, const Make& make_case) {
  std::vector<decltype(make_case())> cases;
  if (subject()->info().kind == kind) cases.push_back(make_case());
  return cases;
}

}  // namespace sidestep::validate
