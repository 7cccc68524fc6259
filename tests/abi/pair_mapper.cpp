#include <sidestep/plugin/plugin.hpp>

namespace {

using namespace sidestep;

struct Options {
  double size_m = 1.0;
  static Parameters<Options> parameters() {
    return Parameters<Options>().add("size_m", &Options::size_m, "Not used.", {.unit = "m"});
  }
};

Result<std::unique_ptr<Mapper>> create(const Options&, const HostContext&) {
  return fail(ErrorCode::kPlugin, "the mapper of two");
}

}  // namespace

SIDESTEP_DESCRIPTOR(mapper_of_two, Mapper, Options, create, "one_of_two", "1",
                    "One of two in a library")
SIDESTEP_PLUGINS(mapper_of_two, cost_of_two)
