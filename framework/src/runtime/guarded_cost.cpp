#include <type_traits>

#include <sidestep/planning/residual_names.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {
namespace {

class GuardedCost : public StateCost {
 public:
  explicit GuardedCost(PluginPtr<StateCost> cost) : cost_(std::move(cost)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return cost_->name(); }
  [[nodiscard]] int residual_count() const noexcept override { return cost_->residual_count(); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override {
    return cost_->depends_on_velocity();
  }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    named([&] { cost_->evaluate(states, out, scratch); });
  }
  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    return named([&] { return cost_->linearise(states, range, out, scratch); });
  }

 protected:
  template <class Call>
  std::invoke_result_t<Call> named(Call&& call) const {
    try {
      return call();
    } catch (...) {
      throw PluginThrew(plugin_of(cost_), text_in_flight());
    }
  }

 private:
  PluginPtr<StateCost> cost_;
};

class GuardedNamingCost final : public GuardedCost, public NamesResiduals {
 public:
  GuardedNamingCost(PluginPtr<StateCost> cost, const NamesResiduals& names)
      : GuardedCost(std::move(cost)), names_(names) {}

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    return named([&] { return names_.residual_name(residual); });
  }

 private:
  const NamesResiduals& names_;  ///< The cost itself.
};

}  // namespace

PluginPtr<StateCost> guard_cost(PluginPtr<StateCost> cost) {
  PluginDeleter deleter{[](void* object) { delete static_cast<StateCost*>(object); },
                        plugin_of(cost)};
  const auto* names = dynamic_cast<const NamesResiduals*>(cost.get());
  StateCost* guarded = names != nullptr ? new GuardedNamingCost(std::move(cost), *names)
                                        : new GuardedCost(std::move(cost));
  return PluginPtr<StateCost>(guarded, std::move(deleter));
}

}  // namespace sidestep
