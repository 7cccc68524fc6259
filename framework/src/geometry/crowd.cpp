#include <sidestep/geometry/crowd.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>

#include "social_force.hpp"

namespace sidestep {
namespace {

constexpr double kHip_m = 0.5;  ///< Share of the height.
constexpr double kLegRadius_m = 0.08;
constexpr double kLegApart_m = 0.1;  ///< From the middle to a leg.
constexpr double kStride_m = 1.4;    ///< Two steps of somebody who walks at 1.2 m/s.
constexpr double kSwing_rad = 0.4;   ///< Of a leg, forwards and back, at that speed.
constexpr double kUnhurried_mps = 1.2;
constexpr double kFromRobot_m = 0.1;  ///< That people leave between their feet and a robot.
constexpr double kArrived_m = 0.3;    ///< From a place on the way: on to the next.
constexpr double kPatience_s = 3.0;   ///< Stuck for so long: the same.
constexpr double kStuck = 0.2;        ///< Of the preferred speed, and less.
constexpr double kAway_m = -1000.0;   ///< Height of those who are not there.
constexpr double kInstant_s = 1e-6;   ///< In which they come and go.
constexpr double kWallsFrom_m = 2.0;  ///< Farther ones are not walked around.
constexpr double kRoom_m = 0.1;       ///< Beside people where they are drawn.
constexpr double kGoing_mps = 0.05;   ///< A robot that is slower has no direction.
constexpr double kHunts_s = 6.0;      ///< Then a hunter goes back, and for as long lets it be.
constexpr double kCaught_m = 0.25;  ///< From the robot's middle to a hunter who need go no nearer.
constexpr int kDraws = 1000;
constexpr double kPerPlace_s = 5.0;  ///< Places drawn for so long a walk, at least.

/// Nearest thing that stands, at the heights of legs, hips and shoulders.
std::optional<OrcaWall> wall_near(const Scene& standing, const Eigen::Vector2d& place_m,
                                  double reach_m) {
  if (standing.objects().empty()) return {};
  double nearest_m = reach_m;
  std::optional<OrcaWall> wall;
  for (const double height_m : {0.3, 0.9, 1.4}) {
    const auto distance_m = [&](double dx, double dy) {
      return standing.signed_distance({place_m.x() + dx, place_m.y() + dy, height_m}, 0.0)
          .distance_m;
    };
    const double here_m = distance_m(0.0, 0.0);
    if (here_m >= nearest_m) continue;
    constexpr double kStep_m = 1e-4;
    const Eigen::Vector2d gradient(distance_m(kStep_m, 0.0) - distance_m(-kStep_m, 0.0),
                                   distance_m(0.0, kStep_m) - distance_m(0.0, -kStep_m));
    if (gradient.norm() < kStep_m) continue;  // above or below
    nearest_m = here_m;
    wall = OrcaWall{place_m - here_m * gradient.normalized()};
  }
  return wall;
}

double clearance_m(const Scene& standing, const Eigen::Vector2d& place_m) {
  double least_m = kInfinity;
  for (const double height_m : {0.3, 0.9, 1.4}) {
    least_m = std::min(
        least_m, standing.signed_distance({place_m.x(), place_m.y(), height_m}, 0.0).distance_m);
  }
  return least_m;
}

Scene what_stands(const std::vector<SceneObject>& objects) {
  std::vector<SceneObject> standing;
  for (const SceneObject& object : objects) {
    if (object.moves() || object.person >= 0) continue;
    if (std::holds_alternative<HalfSpace>(object.shape)) continue;  // the floor
    standing.push_back(object);
  }
  return Scene(std::move(standing));
}

bool is_walkable(const Scene& standing, const Eigen::Vector2d& from_m, const Eigen::Vector2d& to_m,
                 double radius_m) {
  const int pieces = static_cast<int>(std::ceil((to_m - from_m).norm() / 0.1));
  for (int i = 0; i <= pieces; ++i) {
    const double share = pieces > 0 ? static_cast<double>(i) / pieces : 0.0;
    if (clearance_m(standing, from_m + share * (to_m - from_m)) < radius_m) return false;
  }
  return true;
}

/// Draws the persons of one group after another.
class Drawing {
 public:
  Drawing(const std::vector<SceneObject>& objects, const People& people, std::uint64_t seed)
      : people_(people), standing_(what_stands(objects)), seed_(seed) {}

  Result<std::vector<Person>> draw() {
    for (const Person& person : people_.persons) persons_.push_back(person);
    for (const PeopleGroup& group : people_.groups) {
      for (int i = 0; i < group.count; ++i) SIDESTEP_TRY(draw_one(group, i));
    }
    return std::move(persons_);
  }

 private:
  Result<void> draw_one(const PeopleGroup& group, int number) {
    Person person = group.common;
    if (group.count > 1) person.name += "_" + std::to_string(number + 1);
    std::mt19937_64 generator(derive_seed(seed_, "person/" + person.name));
    const auto drawn = [&](double lower, double upper) {
      return std::uniform_real_distribution<double>(lower, upper)(generator);
    };
    person.radius_m = drawn(group.radius_m.x(), group.radius_m.y());
    person.speed_mps = drawn(group.speed_mps.x(), group.speed_mps.y());
    const bool is_hunter = person.policy == Person::Policy::kHunter;
    if (is_hunter) person.wakes_m = drawn(group.wakes_m.x(), group.wakes_m.y());
    if (drawn(0.0, 1.0) < group.blind_share) person.sees_robot = Person::Sees::kNever;
    const auto refuse = [&](const std::string& what, const std::string& hint) {
      return fail(ErrorCode::kConfig, "person '" + person.name + "' " + what,
                  group.mark.to_string(), hint);
    };
    if (person.policy == Person::Policy::kSudden) {
      person.after_m = drawn(group.after_m.x(), group.after_m.y());
      persons_.push_back(std::move(person));
      return {};
    }
    if (!person.route_m.empty()) {
      const double clear_m = clearance_m(standing_, person.route_m.front());
      if (clear_m < person.radius_m) {
        return refuse("starts inside an object of the scene", "give it another start");
      }
    } else {
      const auto somewhere = [&] {
        return Eigen::Vector2d(drawn(person.area.min().x(), person.area.max().x()),
                               drawn(person.area.min().y(), person.area.max().y()));
      };
      // As many as it may come to in that time; at least one to go to.
      const double longest_m = person.area.sizes().norm();
      const double places =
          people_.duration_s * std::min(1.0 / kPerPlace_s, 3.0 * person.speed_mps / longest_m);
      const auto wanted =
          is_hunter ? std::size_t{1} : static_cast<std::size_t>(std::clamp(places, 2.0, 200.0));
      for (int tries = 0; person.route_m.size() < wanted; ++tries) {
        if (tries == kDraws) {
          return refuse("finds no free way in its area", "a larger area, or fewer people");
        }
        const Eigen::Vector2d place_m = somewhere();
        const bool is_start = person.route_m.empty();
        const bool is_free =
            is_start ? is_free_start(place_m, person.radius_m)
                     : is_walkable(standing_, person.route_m.back(), place_m, person.radius_m);
        if (!is_free) continue;
        person.route_m.push_back(place_m);
        tries = 0;
      }
    }
    persons_.push_back(std::move(person));
    return {};
  }

  [[nodiscard]] bool is_free_start(const Eigen::Vector2d& place_m, double radius_m) const {
    if (clearance_m(standing_, place_m) < radius_m) return false;
    return std::ranges::none_of(persons_, [&](const Person& other) {
      return !other.route_m.empty() &&
             (other.route_m.front() - place_m).norm() < other.radius_m + radius_m + kRoom_m;
    });
  }

  const People& people_;
  Scene standing_;
  std::uint64_t seed_;
  std::vector<Person> persons_;
};

struct Seen {
  Eigen::Vector2d place_m;
  Eigen::Vector2d velocity_mps;
};

/// Where a recorded person was; nothing before and after its recording.
std::optional<Seen> recorded_at(const Person& person, double time_s) {
  const auto& recorded = person.recorded;
  if (time_s < recorded.front().time_s || time_s > recorded.back().time_s) return {};
  if (recorded.size() == 1) return Seen{recorded.front().place_m, Eigen::Vector2d::Zero()};
  auto after = std::ranges::upper_bound(recorded, time_s, {}, &TimedPlace::time_s);
  if (after == recorded.end()) --after;
  const auto before = std::prev(after);
  const Eigen::Vector2d velocity_mps =
      (after->place_m - before->place_m) / (after->time_s - before->time_s);
  return Seen{before->place_m + (time_s - before->time_s) * velocity_mps, velocity_mps};
}

/// The objects of a body, all about the middle of their shapes.
std::vector<SceneObject> body_of(const Person& person, int index) {
  const auto part = [&](const std::string& name, Shape shape) {
    SceneObject object;
    object.name = name;
    object.shape = std::move(shape);
    object.person = index;
    return object;
  };
  if (person.box_m) {
    return {part(person.name, Box{{person.box_m->x(), person.box_m->y(), person.height_m}})};
  }
  if (!person.has_legs) return {part(person.name, Cylinder{person.radius_m, person.height_m})};
  const double hip_m = kHip_m * person.height_m;
  const double torso_m = std::max(1e-3, person.height_m - hip_m - 2.0 * person.radius_m);
  const double leg_m = hip_m - 2.0 * kLegRadius_m;
  return {part(person.name, Capsule{person.radius_m, torso_m}),
          part(person.name + "_left_leg", Capsule{kLegRadius_m, leg_m}),
          part(person.name + "_right_leg", Capsule{kLegRadius_m, leg_m})};
}

/// By which its legs swing at a speed, forwards and back.
double swing_of(double speed_mps) { return kSwing_rad * std::min(1.5, speed_mps / kUnhurried_mps); }

/// How far from its middle a body reaches at its preferred speed.
double reach_of(const Person& person) {
  if (!person.has_legs) return person.radius_m;
  return std::max(person.radius_m,
                  kLegRadius_m + kHip_m * person.height_m * std::sin(swing_of(person.speed_mps)));
}

/// Where those are.
std::vector<Transform> poses_of(const Person& person, const Eigen::Vector2d& place_m,
                                double heading_rad, double stride_rad, double speed_mps) {
  Transform at = Transform::Identity();
  at.translation() << place_m, 0.0;
  at.rotate(Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ()));
  const auto raised = [&](double height_m) {
    return Transform(at * Eigen::Translation3d(0.0, 0.0, height_m));
  };
  if (!person.has_legs) return {raised(0.5 * person.height_m)};
  const double hip_m = kHip_m * person.height_m;
  std::vector<Transform> poses = {raised(0.5 * (hip_m + person.height_m))};
  const double swing_rad = swing_of(speed_mps) * std::sin(stride_rad);
  for (const double side : {1.0, -1.0}) {
    Transform leg = at * Eigen::Translation3d(0.0, side * kLegApart_m, hip_m);
    leg.rotate(Eigen::AngleAxisd(side * swing_rad, Eigen::Vector3d::UnitY()));
    poses.push_back(leg * Eigen::Translation3d(0.0, 0.0, -0.5 * hip_m));
  }
  return poses;
}

}  // namespace

Result<Scene> with_people(std::vector<SceneObject> objects, const People& people,
                          std::uint64_t seed) {
  People drawn = people;
  drawn.persons = SIDESTEP_TRY(Drawing(objects, people, seed).draw());
  drawn.groups.clear();
  for (std::size_t i = 0; i < drawn.persons.size(); ++i) {
    const Person& person = drawn.persons[i];
    auto body = body_of(person, static_cast<int>(i));
    Seen start{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
    const bool is_recorded = person.policy == Person::Policy::kRecorded;
    const auto seen = is_recorded ? recorded_at(person, 0.0) : std::nullopt;
    if (seen) start = *seen;
    const bool is_there = seen || !person.route_m.empty();
    if (!person.route_m.empty()) start.place_m = person.route_m.front();
    auto poses = poses_of(person, start.place_m,
                          std::atan2(start.velocity_mps.y(), start.velocity_mps.x()), 0.0, 0.0);
    for (std::size_t k = 0; k < body.size(); ++k) {
      if (!is_there) poses[k].translation().z() = kAway_m;
      body[k].waypoints = {{0.0, poses[k]}};
      objects.push_back(std::move(body[k]));
    }
  }
  return Scene(std::move(objects), std::move(drawn));
}

Crowd::Crowd(const Scene& scene)
    : objects_(scene.objects()), people_(scene.people()), standing_(what_stands(objects_)) {
  for (const Person& person : people_.persons) {
    Walker walker;
    if (person.policy == Person::Policy::kSudden) {
      walker.is_there = false;
      sees_robot_ = true;
    } else if (person.policy != Person::Policy::kRecorded) {
      walker.place_m = person.route_m.front();
      sees_robot_ |=
          person.sees_robot != Person::Sees::kNever || person.policy == Person::Policy::kHunter;
    } else if (const auto seen = recorded_at(person, 0.0)) {
      walker.place_m = seen->place_m;
      walker.velocity_mps = seen->velocity_mps;
    } else {
      walker.is_there = false;
    }
    walkers_.push_back(walker);
  }
  for (std::size_t i = objects_.size(); i-- > 0;) {
    if (objects_[i].person >= 0) walkers_[idx(objects_[i].person)].object = i;
  }
}

Eigen::Vector2d Crowd::preferred(const Person& person, Walker& walker) const {
  const std::size_t places = person.route_m.size();
  if (places < 2) return Eigen::Vector2d::Zero();
  const auto offset_m = [&]() -> Eigen::Vector2d {
    return person.route_m[walker.next] - walker.place_m;
  };
  const auto is_done = [&] {
    return offset_m().norm() < kArrived_m || walker.stuck_s > kPatience_s;
  };
  for (std::size_t i = 0; i < places && is_done(); ++i) {
    if (walker.next + 1 == places && !person.repeats) break;
    walker.next = (walker.next + 1) % places;
    walker.stuck_s = 0.0;
  }
  // It slows down in the last second.
  const double distance_m = offset_m().norm();
  return std::min(person.speed_mps / std::max(distance_m, 1e-9), 1.0) * offset_m();
}

/// It makes for the robot for a while, and then goes back to where it hides.
Eigen::Vector2d Crowd::hunt(const Person& person, Walker& walker,
                            const std::optional<OrcaAgent>& robot) const {
  const Eigen::Vector2d home_m = person.route_m.front() - walker.place_m;
  const Eigen::Vector2d way_m =
      robot ? Eigen::Vector2d(robot->position_m - walker.place_m) : home_m;
  if (walker.hunts_s < 0.0) {
    walker.hunts_s = std::min(0.0, walker.hunts_s + people_.step_s);
  } else if (robot && (walker.hunts_s > 0.0 || way_m.norm() < person.wakes_m)) {
    walker.hunts_s += people_.step_s;
    if (walker.hunts_s > kHunts_s) walker.hunts_s = -kHunts_s;
  }
  const bool is_hunting = walker.hunts_s > 0.0;
  const Eigen::Vector2d to_m = is_hunting ? way_m : home_m;
  const double far_m = to_m.norm();
  if (is_hunting && far_m <= person.radius_m + kCaught_m) return Eigen::Vector2d::Zero();
  // Where something stands in between, past it: first on one side, then on the other.
  const double turn_rad = walker.stuck_s == 0.0 ? 0.0 : walker.stuck_s < 1.0 ? 1.3 : -1.3;
  const double speed_mps = is_hunting ? person.speed_mps : std::min(person.speed_mps, far_m);
  return speed_mps / std::max(far_m, 1e-9) * (Eigen::Rotation2Dd(turn_rad) * to_m);
}

Eigen::Vector2d Crowd::choose(std::size_t index, const Eigen::Vector2d& preferred_mps,
                              const std::optional<OrcaAgent>& robot) const {
  constexpr double kSkin_m = 0.01;
  const Person& person = people_.persons[index];
  const Walker& walker = walkers_[index];
  if (person.policy == Person::Policy::kWaypoints) return preferred_mps;
  std::vector<OrcaAgent> others;
  for (std::size_t i = 0; i < walkers_.size(); ++i) {
    if (i == index || !walkers_[i].is_there) continue;
    others.push_back(
        {walkers_[i].place_m, walkers_[i].velocity_mps, people_.persons[i].radius_m + kSkin_m});
  }
  if (robot && person.sees_robot != Person::Sees::kNever) {
    const Eigen::Vector2d heading(std::cos(walker.heading_rad), std::sin(walker.heading_rad));
    const bool is_in_front = heading.dot(robot->position_m - walker.place_m) > 0.0;
    if (is_in_front || person.sees_robot == Person::Sees::kAlways) {
      others.push_back(*robot);
      others.back().radius_m += kFromRobot_m + reach_of(person) - person.radius_m;
    }
  }
  std::vector<OrcaWall> walls;
  if (const auto wall = wall_near(standing_, walker.place_m, kWallsFrom_m)) walls.push_back(*wall);
  OrcaAgent self{walker.place_m, walker.velocity_mps, person.radius_m + kSkin_m};
  const double step_s = people_.step_s;
  if (person.policy == Person::Policy::kOrca || person.policy == Person::Policy::kHunter) {
    OrcaSettings settings;
    settings.step_s = step_s;
    return orca_velocity(self, preferred_mps, person.speed_mps, others, walls, settings);
  }
  const int pieces = std::max(1, static_cast<int>(std::ceil(step_s / 0.02)));
  for (int i = 0; i < pieces; ++i) {
    self.velocity_mps += step_s / pieces * social_force(self, preferred_mps, others, walls);
    const double fastest_mps = 1.3 * person.speed_mps;
    if (self.velocity_mps.norm() > fastest_mps) {
      self.velocity_mps *= fastest_mps / self.velocity_mps.norm();
    }
    self.position_m += step_s / pieces * self.velocity_mps;
  }
  return (self.position_m - walker.place_m) / step_s;
}

void Crowd::note_bodies(std::size_t index, bool was_there) {
  const Person& person = people_.persons[index];
  Walker& walker = walkers_[index];
  if (!was_there && !walker.is_there) return;
  const double step_s = people_.step_s;
  const double time_s = static_cast<double>(steps_) * step_s, next_s = time_s + step_s;
  const double speed_mps = walker.velocity_mps.norm();
  if (speed_mps > 0.05) {
    walker.heading_rad = std::atan2(walker.velocity_mps.y(), walker.velocity_mps.x());
  }
  walker.stride_rad += 2.0 * std::numbers::pi * speed_mps * step_s / kStride_m;
  const auto poses =
      poses_of(person, walker.place_m, walker.heading_rad, walker.stride_rad, speed_mps);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    std::vector<Waypoint>& way = objects_[walker.object + k].waypoints;
    Waypoint away{0.0, way.back().T_world_object};
    away.T_world_object.translation().z() = kAway_m;
    if (!walker.is_there) {  // gone since the last step
      away.time_s = time_s + kInstant_s;
      way.push_back(away);
      continue;
    }
    away.time_s = next_s - kInstant_s;
    if (!was_there) way.push_back(away);
    way.push_back({next_s, poses[k]});
  }
}

void Crowd::follow_robot(const OrcaAgent& robot) {
  if (robot_m_) robot_way_m_ += (robot.position_m - *robot_m_).norm();
  robot_m_ = robot.position_m;
}

/// It comes once there is room for it in the robot's way.
void Crowd::appear(std::size_t index, const OrcaAgent& robot) {
  const Person& person = people_.persons[index];
  const double speed_mps = robot.velocity_mps.norm();
  if (robot_way_m_ < person.after_m || speed_mps < kGoing_mps) return;
  const Eigen::Vector2d ahead = robot.velocity_mps / speed_mps;
  const Eigen::Vector2d place_m = robot.position_m + person.ahead_m * ahead;
  if (person.ahead_m < person.radius_m + robot.radius_m || !person.area.contains(place_m) ||
      clearance_m(standing_, place_m) < person.radius_m) {
    return;
  }
  for (std::size_t i = 0; i < walkers_.size(); ++i) {
    const double apart_m = (walkers_[i].place_m - place_m).norm();
    const bool is_on_it = apart_m < person.radius_m + people_.persons[i].radius_m;
    if (walkers_[i].is_there && is_on_it) return;
  }
  Walker& walker = walkers_[index];
  walker.is_there = true;
  walker.place_m = place_m;
  walker.heading_rad = std::atan2(ahead.y(), ahead.x());
}

bool Crowd::advance(double until_s, const std::optional<OrcaAgent>& robot) {
  const double step_s = people_.step_s;
  const std::int64_t before = steps_;
  if (robot) follow_robot(*robot);
  for (; static_cast<double>(steps_) * step_s < until_s; ++steps_) {
    // Everybody chooses, and then everybody goes.
    std::vector<Eigen::Vector2d> velocities(walkers_.size(), Eigen::Vector2d::Zero());
    for (std::size_t i = 0; i < walkers_.size(); ++i) {
      const Person& person = people_.persons[i];
      if (person.route_m.empty()) continue;
      const Eigen::Vector2d preferred_mps = person.policy == Person::Policy::kHunter
                                                ? hunt(person, walkers_[i], robot)
                                                : preferred(person, walkers_[i]);
      velocities[i] = choose(i, preferred_mps, robot);
      const bool is_stuck = velocities[i].norm() < kStuck * preferred_mps.norm();
      walkers_[i].stuck_s = is_stuck ? walkers_[i].stuck_s + step_s : 0.0;
    }
    for (std::size_t i = 0; i < walkers_.size(); ++i) {
      Walker& walker = walkers_[i];
      const bool was_there = walker.is_there;
      if (people_.persons[i].policy == Person::Policy::kRecorded) {
        const auto seen = recorded_at(people_.persons[i], static_cast<double>(steps_ + 1) * step_s);
        walker.is_there = seen.has_value();
        if (seen) walker.place_m = seen->place_m;
        if (seen) walker.velocity_mps = seen->velocity_mps;
      } else if (people_.persons[i].policy == Person::Policy::kSudden) {
        if (robot && !was_there) appear(i, *robot);
      } else {
        walker.velocity_mps = velocities[i];
        walker.place_m += step_s * velocities[i];
      }
      note_bodies(i, was_there);
    }
  }
  return steps_ > before;
}

std::size_t Crowd::first_body() const noexcept {
  return walkers_.empty() ? objects_.size() : walkers_.front().object;
}

std::vector<Transform> Crowd::poses(double time_s) const {
  std::vector<Transform> poses;
  for (std::size_t i = first_body(); i < objects_.size(); ++i) {
    poses.push_back(objects_[i].T_world_object(time_s));
  }
  return poses;
}

Scene walked(const Scene& drawn) {
  Crowd crowd(drawn);
  crowd.advance(drawn.people().persons.empty() ? 0.0 : drawn.people().duration_s, {});
  return crowd.scene();
}

}  // namespace sidestep
