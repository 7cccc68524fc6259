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

/// The robot's shapes at one pose, and how they were at the pose before.
class Inspection {
 public:
  Inspection(const std::shared_ptr<const RobotModel>& robot, const ShapeCollider& collider,
             double apart_s, TrueMotion& motion)
      : robot_(*robot),
        collider_(collider),
        apart_s_(apart_s),
        motion_(motion),
        now_(collider.make_pose()),
        before_(collider.make_pose()),
        T_world_link_(robot->description().links.size()) {
    auto head = Head::create(robot);
    if (!head) return;
    head_ = std::move(*head);
    for (int pair = 0; pair < collider.pair_count(); ++pair) {
      const auto [one, other] = collider.pair_links(pair);
      if (head_->carries(one) != head_->carries(other)) pairs_of_head_.push_back(pair);
    }
  }

  void inspect(const TruePose& pose, const TruePose& previous) {
    place(pose, pose.time_s, *now_);
    if (pose.head) inspect_head(pose.time_s);
    const double bound_m = std::max(0.0, motion_.min_clearance_m);
    for (int s = 0; s < collider_.shape_count(); ++s) {
      const auto found = collider_.to_obstacles(s, *now_, bound_m);
      if (found.other.empty()) continue;
      const RobotDescription& robot = robot_.description();
      const std::string& link = robot.links[idx(robot.shapes[idx(s)].link)].name;
      if (found.clearance_m < motion_.min_clearance_m) {
        motion_.min_clearance_m = found.clearance_m;
        motion_.nearest_link = link;
        motion_.nearest_object = found.other;
        motion_.nearest_s = pose.time_s;
      }
      if (found.clearance_m >= 0.0) continue;
      const double approach_mps = approach(s, found.clearance_m, pose, previous);
      note_contact({link, found.other, pose.time_s, pose.time_s, -found.clearance_m, approach_mps},
                   apart_s_, motion_.contacts);
    }
  }

 private:
  void place(const TruePose& pose, double time_s, ShapeCollider::Pose& into) {
    robot_.link_poses(as_span(pose.q), T_world_link_, scratch_);
    if (pose.head && head_) head_->place(*pose.head, T_world_link_);
    collider_.place(into, T_world_link_, time_s);
  }

  void inspect_head(double time_s) {
    for (const int pair : pairs_of_head_) {
      const double clearance_m = collider_.between_pair(pair, *now_, 0.0);
      if (clearance_m >= 0.0) continue;
      auto [carried, other] = collider_.pair_links(pair);
      if (!head_->carries(carried)) std::swap(carried, other);
      const auto& links = robot_.description().links;
      note_contact({links[idx(carried)].name, links[idx(other)].name, time_s, time_s, -clearance_m,
                    0.0, true},
                   apart_s_, motion_.contacts);
    }
  }

  /// By how much a shape has come nearer, a second, to things as they stand now: its velocity along
  /// the normal, wherever that points. 0 where nothing was near at the pose before: a recorded
  /// person who begins within the robot.
  double approach(int shape, double clearance_m, const TruePose& pose, const TruePose& previous) {
    const double time_s = pose.time_s - previous.time_s;
    if (time_s <= 0.0) return 0.0;
    constexpr double kSearched_m = 0.1;
    place(previous, previous.time_s, *before_);
    if (collider_.to_obstacles(shape, *before_, kSearched_m).other.empty()) return 0.0;
    place(previous, pose.time_s, *before_);
    const auto found = collider_.to_obstacles(shape, *before_, kSearched_m);
    return ((found.other.empty() ? kSearched_m : found.clearance_m) - clearance_m) / time_s;
  }

  const RobotModel& robot_;
  std::optional<Head> head_;        ///< Where it has one.
  std::vector<int> pairs_of_head_;  ///< Of shapes, of which it carries one.
  const ShapeCollider& collider_;
  double apart_s_;
  TrueMotion& motion_;
  ShapeCollider::PosePtr now_, before_;
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

/// Whatever half-spaces there are: a robot is always near to its floor.
std::vector<TrueClearance> clearances_over_time(const std::shared_ptr<const RobotModel>& model,
                                                const Scene& scene, std::span<const TruePose> poses,
                                                const TrueMotionSettings& settings) {
  const RobotModel& robot = *model;
  const auto head = Head::create(model);
  std::vector<SceneObject> objects = scene.objects();
  std::erase_if(objects, [](const SceneObject& object) {
    return std::holds_alternative<HalfSpace>(object.shape);
  });
  ShapeObstacles obstacles;
  obstacles.scene = std::make_shared<const Scene>(std::move(objects));
  const ShapeCollider collider(robot.description(), obstacles, settings.allowed_contacts);
  const auto placed = collider.make_pose();
  std::vector<Transform> T_world_link(robot.description().links.size());
  Scratch scratch;
  std::vector<TrueClearance> clearances;
  constexpr double kRounding_s = 1e-6;
  for (const TruePose& pose : poses) {
    const double due_s = pose.time_s - settings.every_s + kRounding_s;
    if (!clearances.empty() && clearances.back().time_s > due_s) continue;
    robot.link_poses(as_span(pose.q), T_world_link, scratch);
    if (pose.head && head) head->place(*pose.head, T_world_link);
    collider.place(*placed, T_world_link, pose.time_s);
    double clearance_m = settings.farthest_over_time_m;
    for (int s = 0; s < collider.shape_count(); ++s) {
      clearance_m = std::min(clearance_m, collider.gap_to_obstacles_m(s, *placed, clearance_m));
    }
    clearances.push_back({pose.time_s, clearance_m});
  }
  return clearances;
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
  TrueMotion motion;
  motion.min_clearance_m = settings.farthest_m;
  Inspection inspection(robot, collider, settings.apart_s, motion);
  const TruePose* previous = nullptr;
  for (const TruePose& pose : poses) {
    if (pose.q.size() != description.dof()) {
      return invalid("a true pose has " + std::to_string(pose.q.size()) + " joints, but " +
                     description.name + " has " + std::to_string(description.dof()));
    }
    inspection.inspect(pose, previous != nullptr ? *previous : pose);
    previous = &pose;
  }
  motion.clearances = clearances_over_time(robot, *scene, poses, settings);
  return motion;
}

}  // namespace sidestep
