#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  double weight = 1.0;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("weight", &Options::weight, "Not used.");
  }
};

Result<std::unique_ptr<StateCost>> create(const Options&, const HostContext&) {
  return fail(ErrorCode::kPlugin, "the cost of two");
}

}  // namespace

SIDESTEP_DESCRIPTOR(cost_of_two, StateCost, Options, create, "one_of_two", "2", "The other")
