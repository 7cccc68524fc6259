#include <sidestep/core/index.hpp>
#include <sidestep/runtime/truth_check.hpp>

#include <algorithm>
#include <optional>

#include "shape_collider.hpp"

namespace sidestep {
namespace {

void note_contact(TrueContact contact, double apart_s, std::vector<TrueContact>& contacts) {
  for (auto known = contacts.rbegin(); known != contacts.rend(); ++known) {
    if (known->object != contact.object) continue;
    if (contact.begin_s - known->end_s > apart_s) break;
    known->end_s = contact.begin_s;
    if (contact.depth_m > known->depth_m) {
      known->depth_m = contact.depth_m;
      known->link = std::move(contact.link);
    }
    return;
  }
  contacts.push_back(std::move(contact));
}

/// All shapes of the robot at one pose.
void inspect(const ShapeCollider& collider, const ShapeCollider::Pose& placed,
             const RobotDescription& robot, double time_s, double apart_s, TrueMotion& motion) {
  const double bound_m = std::max(0.0, motion.min_clearance_m);
  for (int s = 0; s < collider.shape_count(); ++s) {
    const auto found = collider.to_obstacles(s, placed, bound_m);
    if (found.other.empty()) continue;
    const int link = robot.shapes[idx(s)].link;
    const std::string& name = robot.links[idx(link)].name;
    if (found.clearance_m < motion.min_clearance_m) {
      motion.min_clearance_m = found.clearance_m;
      motion.nearest_link = name;
      motion.nearest_object = found.other;
      motion.nearest_s = time_s;
    }
    if (found.clearance_m < 0.0) {
      note_contact({name, found.other, time_s, time_s, -found.clearance_m}, apart_s,
                   motion.contacts);
    }
  }
}

}  // namespace

Result<TrueMotion> check_true_motion(const std::shared_ptr<const RobotModel>& robot,
                                     const std::shared_ptr<const Scene>& scene,
                                     std::span<const TruePose> poses,
                                     const TrueMotionSettings& settings) {
  ShapeObstacles obstacles;
  obstacles.scene = scene;
  ShapeCheckSettings of_check;
  of_check.allowed_contacts = settings.allowed_contacts;
  SIDESTEP_TRY(make_shape_check(robot, obstacles, of_check));
  const RobotDescription& description = robot->description();
  const ShapeCollider collider(description, obstacles, settings.allowed_contacts);
  const ShapeCollider::PosePtr placed = collider.make_pose();
  std::vector<Transform> T_world_link(description.links.size());
  Scratch scratch;
  TrueMotion motion;
  motion.min_clearance_m = settings.farthest_m;
  for (const TruePose& pose : poses) {
    if (pose.q.size() != description.dof()) {
      return invalid("a true pose has " + std::to_string(pose.q.size()) + " joints, but " +
                     description.name + " has " + std::to_string(description.dof()));
    }
    robot->link_poses(as_span(pose.q), T_world_link, scratch);
    collider.place(*placed, T_world_link, pose.time_s);
    inspect(collider, *placed, description, pose.time_s, settings.apart_s, motion);
  }
  return motion;
}

}  // namespace sidestep
