#pragma once

#include <string>

#include <sidestep/planning/problem.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "describe.hpp"

namespace sidestep::gp_chain_cuda {

/// What kernels do not know, and the way out.
[[nodiscard]] tl::unexpected<Error> unknown(std::string message);

[[nodiscard]] inline Vec3 vec3(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

/// Adds a problem's terms to what is known of it. Fails as describe() does.
[[nodiscard]] Result<void> describe_terms(const Problem& problem, const KinematicTree& tree,
                                          DescribedProblem& out);

}  // namespace sidestep::gp_chain_cuda
