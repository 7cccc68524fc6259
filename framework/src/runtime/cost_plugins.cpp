#include <sidestep/runtime/cost_plugins.hpp>

#include <algorithm>
#include <array>
#include <utility>

#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

/// Of the standard terms, by which results and explanations know them.
constexpr std::array<std::string_view, 9> kTakenNames = {
    "gp_prior", "start",          "goal",           "goal_velocity", "obstacle",
    "floor",    "self_collision", "position_limit", "velocity_limit"};

Placement placement_of(const std::string& at) {
  if (at == "start") return Placement::kStart;
  if (at == "goal") return Placement::kGoal;
  return at == "support" ? Placement::kSupport : Placement::kSupportAndInterpolated;
}

/// What keeps a plugin's cost from being used; empty if nothing does.
std::string cost_mistake(const StateCost& cost) {
  const std::string name(cost.name());
  if (name.empty()) return "the cost has no name";
  if (std::ranges::find(kTakenNames, name) != kTakenNames.end()) {
    return "the cost is named '" + name + "', as one of Sidestep's own";
  }
  if (cost.residual_count() < 1) return "the cost '" + name + "' has no residuals";
  return "";
}

}  // namespace

Parameters<PluginCostEntry> PluginCostEntry::parameters() {
  using E = PluginCostEntry;
  return Parameters<E>()
      .add("cost", &E::cost, "A plugin of kind `cost`, with its parameters: `{plugin: NAME, ...}`.",
           {.required = true, .plugin = PluginKind::kCost})
      .add("at", &E::at, "The states at which it applies.",
           {.choices = {"start", "goal", "support", "support_and_interpolated"}})
      .add("frees_goal", &E::frees_goal,
           "Whether the goal configuration is left to it, as to `end_effector`; for one at the "
           "goal.");
}

void read_plugin_costs(const Node& plan, const std::shared_ptr<const RobotModel>& robot, Host& host,
                       Task& task, std::vector<Error>& errors) {
  const Node* list = plan.find("costs");
  if (list == nullptr) return;
  for (const Node& block : list->items()) {
    PluginCostEntry entry;
    if (!read_entry(block, entry)) continue;
    if (entry.frees_goal && entry.at != "goal") {
      errors.push_back(
          block.find("frees_goal")->error("only a cost at the goal can free it", "say `at: goal`"));
    }
    std::vector<Error> told;
    host.check(PluginKind::kCost, entry.cost, told);
    if (!told.empty()) continue;
    auto cost = host.create<StateCost>(entry.cost, robot);
    if (!cost) {
      errors.push_back(std::move(cost.error()));
      continue;
    }
    if (const std::string mistake = cost_mistake(**cost); !mistake.empty()) {
      errors.push_back(entry.cost.error(mistake));
      continue;
    }
    task.frees_goal |= entry.frees_goal;
    task.terms.push_back(
        {std::shared_ptr<const StateCost>(std::move(*cost)), placement_of(entry.at)});
  }
}

}  // namespace sidestep
