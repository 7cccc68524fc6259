#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include <sidestep/core/error.hpp>
#include <sidestep/core/node.hpp>

namespace sidestep {

/// Where a recorded person was at a time. World frame.
struct TimedPlace {
  double time_s = 0.0;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();
};

/// One person of a scene, all that differs from episode to episode drawn.
struct Person {
  enum class Policy {
    kWaypoints,    ///< Straight from place to place, whatever is there.
    kOrca,         ///< Reciprocal avoidance (geometry/orca.hpp).
    kSocialForce,  ///< Helbing and Molnar, "Social force model for pedestrian dynamics", 1995.
    kRecorded,     ///< As it was recorded; there only while it was.
    kSudden,       ///< Not there until it stands in the robot's way, from one moment to the next.
    kHunter,       ///< Hides until the robot comes near, and then makes straight for it.
  };
  enum class Sees { kNever, kAlways, kInFront };

  std::string name;
  Policy policy = Policy::kWaypoints;
  Sees sees_robot = Sees::kNever;
  double radius_m = 0.25;
  double height_m = 1.7;
  double speed_mps = 1.2;  ///< At which it walks where nothing is in its way.
  bool has_legs = true;    ///< A torso on two legs that swing; else one upright cylinder.
  bool repeats = false;    ///< After its last place it goes to the first again.
  std::optional<Eigen::Vector2d> box_m;  ///< Instead of a body: an upright box, deep and wide so.
  double after_m = 1.0;                  ///< Of kSudden: so far the robot has gone before it comes,
  double ahead_m = 1.7;                  ///< so far before the robot's middle it stands then.
  double wakes_m = 3.0;                  ///< Of kHunter: from how near it hunts.
  Eigen::AlignedBox2d area;  ///< Where routes are drawn; where one of kSudden may stand.
  /// The first is where it starts. Empty for recorded people and those of kSudden.
  std::vector<Eigen::Vector2d> route_m;
  std::vector<TimedPlace> recorded;  ///< Times strictly increasing.
};

/// People of a scene as they are written: what is drawn has ranges (docs/reference/scenes.md).
struct PeopleGroup {
  Person common;  ///< `name` is the group's; `route_m` is empty where it is drawn.
  int count = 1;
  Eigen::Vector2d radius_m{0.25, 0.25};  ///< From, to; as the next.
  Eigen::Vector2d speed_mps{1.2, 1.2};
  Eigen::Vector2d after_m{1.0, 1.0};
  Eigen::Vector2d wakes_m{3.0, 3.0};
  double blind_share = 0.0;  ///< How likely one does not see the robot, whatever the others do.
  SourceMark mark;
};

/// The people of a scene.
struct People {
  double step_s = 0.1;              ///< How often they choose where to go.
  double duration_s = 300.0;        ///< For how long they walk; then they stand.
  std::vector<PeopleGroup> groups;  ///< Not drawn yet.
  std::vector<Person> persons;      ///< Recorded, or drawn.
};

/// Reads the `people` block of a scene. Appends all mistakes, each a kConfig error at its position;
/// those of a recording name its file and line.
[[nodiscard]] People read_people(const Node& block, std::vector<Error>& errors);

}  // namespace sidestep
