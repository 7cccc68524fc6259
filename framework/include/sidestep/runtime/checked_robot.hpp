#pragma once

#include <memory>
#include <vector>

#include <sidestep/runtime/configuration.hpp>
#include <sidestep/runtime/host.hpp>

namespace sidestep {

/// The robot of a configuration, created to find what only its files say is wrong; appends that to
/// `errors`. Null then, and where its block is missing or has mistakes, which the host reports.
[[nodiscard]] std::shared_ptr<const RobotModel> checked_robot(const Configuration& configuration,
                                                              Host& host,
                                                              std::vector<Error>& errors);

}  // namespace sidestep
