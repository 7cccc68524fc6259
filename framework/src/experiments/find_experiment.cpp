#include "find_experiment.hpp"

#include <array>
#include <utility>

namespace sidestep {
namespace {

/// Names that experiments had before.
constexpr std::array kFormerNames = {std::pair("replanning", "incremental_benchmark")};

}  // namespace

Result<FoundExperiment> find_experiment(const Node& block, Host& host) {
  auto plugin = host.find(PluginKind::kExperiment, block);
  if (!plugin) {
    Error error = std::move(plugin.error());
    error.code = ErrorCode::kConfig;
    const Node* type = block.find("type");
    for (const auto& [before, now] : kFormerNames) {
      if (type == nullptr || !type->is_scalar() || type->text() != before) continue;
      error = type->error("there is no experiment type '" + type->text() + "' any more",
                          "it is called '" + std::string(now) + "' now");
    }
    return tl::make_unexpected(std::move(error));
  }
  auto experiment = SIDESTEP_TRY(host.create<Experiment>(block));
  return FoundExperiment{*std::move(plugin), std::move(experiment)};
}

Result<FoundExperiment> find_experiment(const std::string& name, const std::string& where,
                                        Host& host) {
  const SourceMark mark{where, 0, 0};
  return find_experiment(
      Node(Node::Map{{"type", mark, Node(Node::Scalar{name, false}, mark)}}, mark), host);
}

Result<std::vector<FoundExperiment>> find_experiments(Host& host) {
  std::vector<FoundExperiment> all;
  for (const PluginInfo& plugin : host.plugins()) {
    if (plugin.kind != PluginKind::kExperiment) continue;
    all.push_back(SIDESTEP_TRY(find_experiment(plugin.name, plugin.library.string(), host)));
  }
  return all;
}

}  // namespace sidestep
