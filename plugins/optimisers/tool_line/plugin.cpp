#include <sidestep/plugin/plugin.hpp>

#include "tool_line.hpp"

namespace sidestep::tool_line {
namespace {

Result<std::unique_ptr<Optimiser>> create(const Options& options, const HostContext& context) {
  return make_tool_line(options, context.log);
}

}  // namespace
}  // namespace sidestep::tool_line

SIDESTEP_PLUGIN(sidestep::Optimiser, sidestep::tool_line::Options, sidestep::tool_line::create,
                "tool_line", "0.1.0",
                "A link moves in a straight line to the pose that is its goal (Cartesian path)")
