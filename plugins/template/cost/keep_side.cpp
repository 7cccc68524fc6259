// A cost: a link is to stay on one side of a plane.
#include "keep_side.hpp"

#include <algorithm>

namespace keep_side {

using namespace sidestep;

Parameters<Options> Options::parameters() {
  return Parameters<Options>()
      .add("link", &Options::link, "The link that is to stay on one side.", {.required = true})
      .add("point_m", &Options::point_m, "A point of the plane, world frame.", {.unit = "m"})
      .add("normal", &Options::normal, "Points from the plane to the side to be on.")
      .add("sigma_m", &Options::sigma_m, "Standard deviation of the distance behind the plane.",
           {.unit = "m", .min = 1e-6});
}

std::vector<OptionMistake> Options::check() const {
  if (normal.norm() > 0.0) return {};
  return {{{"normal"}, "has no direction", {}}};
}

KeepSide::KeepSide(std::shared_ptr<const RobotModel> robot, int link, const Options& options)
    : robot_(std::move(robot)),
      link_(link),
      name_("keep_side_" + options.link),
      point_m_(options.point_m),
      normal_(options.normal.normalized()),
      sigma_m_(options.sigma_m) {}

void KeepSide::evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const {
  // Temporaries come from the scratch, so that nothing is allocated once it is warm.
  Scratch::Scope scope(scratch);
  const auto n = static_cast<std::size_t>(states.count), dof = static_cast<std::size_t>(states.dof);
  const auto poses = scope.array<Transform>(robot_->description().links.size());
  const auto derivatives = scope.array<LinkForce>(n);
  for (std::size_t i = 0; i < n; ++i) {
    robot_->link_poses(states.q.subspan(i * dof, dof), poses, scratch);
    const Eigen::Vector3d p = poses[static_cast<std::size_t>(link_)].translation();
    const double behind_m = -normal_.dot(p - point_m_);
    const bool is_behind = !(behind_m <= 0.0);  // what is not a number is kept
    if (!out.residuals.empty()) out.residuals[i] = is_behind ? behind_m / sigma_m_ : 0.0;
    // The derivative by the link's motion, as a force at its origin; the robot maps it onto joints.
    const Eigen::Vector3d force =
        is_behind ? Eigen::Vector3d(-normal_ / sigma_m_) : Eigen::Vector3d(0.0, 0.0, 0.0);
    derivatives[i] = {static_cast<int>(i), link_, force, p.cross(force)};
  }
  if (!out.jacobian_q.empty()) robot_->pull_back(states.q, derivatives, out.jacobian_q, scratch);
  std::ranges::fill(out.jacobian_qdot, 0.0);
}

ResidualName KeepSide::residual_name(int) const {
  return {robot_->description().links[static_cast<std::size_t>(link_)].name, "", "its side", "m",
          sigma_m_};
}

Result<std::unique_ptr<StateCost>> create(const Options& options, const HostContext& context) {
  const auto link = context.robot->description().link_index(options.link);
  if (!link) {
    return fail(ErrorCode::kConfig, "robot '" + context.robot->description().name +
                                        "' has no link '" + options.link + "'");
  }
  return std::make_unique<KeepSide>(context.robot, *link, options);
}

}  // namespace keep_side

SIDESTEP_PLUGIN(sidestep::StateCost, keep_side::Options, keep_side::create, "keep_side", "0.1.0",
                "A link stays on one side of a plane: an example of a plugin")
