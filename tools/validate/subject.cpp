#include "subject.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include <sidestep/experiments/experiments.hpp>
#include "conformance/analytic_models.hpp"

namespace sidestep::validate {
namespace {

constexpr int kThreads = 2;

/// A document of a case: the plugin's block, a robot's, and what is expected.
Result<Node> read_document(const std::filesystem::path& file, const DocumentReader& documents,
                           const std::string& kind) {
  std::vector<std::string> keys = {kind, "robot", "expect"};
  auto document = SIDESTEP_TRY(documents.read(file));
  if (!document.is_map()) {
    return tl::make_unexpected(
        document.error("a case is a map with the block '" + kind + "', found " + document.kind()));
  }
  for (const Node::Entry& entry : document.entries()) {
    if (std::ranges::find(keys, entry.key) != keys.end()) continue;
    return tl::make_unexpected(
        Error{ErrorCode::kConfig, "unknown key '" + entry.key + "'", entry.key_mark.to_string(),
              did_you_mean(entry.key, keys, "a case has " + joined(keys)), nullptr});
  }
  return document;
}

Result<void> first_of(std::vector<Error> errors) {
  if (errors.empty()) return {};
  return tl::make_unexpected(std::move(errors.front()));
}

}  // namespace

Parameters<Expectations> Expectations::parameters(PluginKind kind) {
  using E = Expectations;
  Parameters<E> none;
  switch (kind) {
    case PluginKind::kField:
      return std::move(none)
          .add("max_error_m", &E::max_error_m,
               "Largest error against the exact transform; 0: equal as float, to the last bit.",
               {.unit = "m", .min = 0.0})
          .add("unknown_is_occupied", &E::unknown_is_occupied,
               "What was never observed counts as an obstacle.");
    case PluginKind::kMapper:
      return std::move(none).add("takes_clouds", &E::takes_clouds,
                                 "Point clouds are integrated, too.");
    case PluginKind::kOptimiser:
      return std::move(none)
          .add("minimises_cost", &E::minimises_cost,
               "False for planners that may ignore initial trajectory and cost.")
          .add("repeatable", &E::repeatable, "Two that are made alike find the same.");
    case PluginKind::kLocaliser:
      return std::move(none).add("moves_freely", &E::moves_freely,
                                 "It takes a sensor without a robot.");
    case PluginKind::kSource:
      return std::move(none)
          .add("is_live", &E::is_live, "Frames come in time or not at all, and not again.")
          .add("truth_error_m", &E::truth_error_m,
               "Where it knows the scene: how far most of what it measures may be from that.",
               {.unit = "m", .min = 0.0});
    case PluginKind::kExecutor:
      return std::move(none)
          .add("tracking_error", &E::tracking_error,
               "How far its robot may be from what it follows, joint by joint.",
               {.unit = "m, rad", .min = 0.0})
          .add("delay_s", &E::delay_s, "After this long it acts on what it is told.",
               {.unit = "s", .min = 0.0})
          .add("braking_share", &E::braking_share, "Of the limits of braking that its stops use.",
               {.min = 0.01, .max = 1.0});
    default: return none;
  }
}

Subject::Subject(const std::filesystem::path& library)
    : workers_(kThreads),
      settings_{host_plugin_paths({library}, install_layout()),
                {install_layout().robots},
                {install_layout().configs / "scenes"}},
      robot_(std::make_shared<conformance::PlanarRobot>(
          conformance::PlanarRobot::Shape{.rotary_joints = 3, .mobile = true})) {}

Host& Subject::host_with(WorkerPool* workers) {
  if (workers == nullptr) workers = &workers_;
  auto& host = hosts_[workers];
  if (!host) host = std::make_unique<Host>(settings_, log_, clock_, *workers, documents_);
  return *host;
}

bool Subject::is_of(const PluginInfo& plugin, const std::filesystem::path& case_file) const {
  const auto document = documents_.read(case_file);
  if (!document) return false;
  const Node* const block = document->find(std::string(to_string(plugin.kind)));
  const Node* const name =
      block == nullptr ? nullptr
                       : block->find(plugin.kind == PluginKind::kExperiment ? "type" : "plugin");
  return name != nullptr && name->is_scalar() && name->text() == plugin.name;
}

Result<void> Subject::find(const std::filesystem::path& library,
                           const std::filesystem::path& case_file) {
  std::vector<PluginInfo> plugins;
  std::ranges::copy_if(host().plugins(), std::back_inserter(plugins),
                       [&](const PluginInfo& plugin) { return plugin.library == library; });
  std::vector<std::string> names;
  for (const PluginInfo& plugin : plugins) {
    names.push_back(std::string(to_string(plugin.kind)) + " " + plugin.name);
    if (plugins.size() > 1 && !is_of(plugin, case_file)) continue;
    info_ = plugin;
    return {};
  }
  if (!names.empty()) {
    return fail(ErrorCode::kConfig, "holds several plugins, " + joined(names), library.string(),
                "give a case file, with the block of one of them");
  }
  for (const PluginRejection& rejection : host().rejections()) {
    if (rejection.library == library) return tl::make_unexpected(rejection.error);
  }
  return fail(ErrorCode::kPlugin, "is no plugin", library.string());
}

Result<void> Subject::read_case(const std::filesystem::path& file) {
  const std::string kind(to_string(info_.kind));
  const std::string key = info_.kind == PluginKind::kExperiment ? "type" : "plugin";
  const SourceMark nowhere{"without a case file", 0, 0};
  block_ = Node(Node::Map{{key, nowhere, Node(Node::Scalar{info_.name, false}, nowhere)}}, nowhere);
  std::vector<Error> errors;
  if (info_.kind == PluginKind::kExperiment) {
    if (file.empty()) {
      return fail(ErrorCode::kConfig, "an experiment needs a configuration to run", info_.name,
                  "name its file after the library");
    }
    auto reading = read_configuration(file, {}, documents_);
    if (!reading.errors.empty()) return first_of(std::move(reading.errors));
    case_ = std::move(reading.configuration);
    SIDESTEP_TRY(first_of(check_configuration(case_, host())));
    block_ = block_of(case_, kind);
  } else {
    if (!file.empty()) {
      case_ = {file.stem(), file, SIDESTEP_TRY(read_document(file, documents_, kind))};
    }
    if (!block_of(case_, kind).is_null()) block_ = block_of(case_, kind);
    host().check(info_.kind, block_, errors);
    const Node& expected = block_of(case_, "expect");
    const auto parameters = Expectations::parameters(info_.kind);
    if (!expected.is_null()) {
      check_against_schema(expected, parameters.schema(), {}, errors);
      if (errors.empty()) parameters.read(expected, expect_, errors);
    }
    SIDESTEP_TRY(first_of(std::move(errors)));
    const Node& robot = block_of(case_, "robot");
    if (info_.kind != PluginKind::kRobot && !robot.is_null()) {
      robot_ = SIDESTEP_TRY(host().create<RobotModel>(robot));
    }
  }
  const Node* const name = block_.find(key);
  if (name != nullptr && name->text() == info_.name) return {};
  return tl::make_unexpected(
      block_.error("'" + kind + "' is not of the library's plugin, '" + info_.name + "'"));
}

Result<std::unique_ptr<Subject>> Subject::open(const std::filesystem::path& library,
                                               const std::filesystem::path& case_file) {
  std::unique_ptr<Subject> subject(new Subject(library));
  SIDESTEP_TRY(subject->find(library, case_file));
  SIDESTEP_TRY(subject->read_case(case_file));
  return subject;
}

std::unique_ptr<Subject>& subject() {
  static std::unique_ptr<Subject> one;
  return one;
}

}  // namespace sidestep::validate
