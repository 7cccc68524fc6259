#include "course.hpp"

#include <algorithm>
#include <array>

#include <sidestep/core/index.hpp>
#include <sidestep/report/chart.hpp>

namespace sidestep {
namespace {

using namespace report;

/// Where the first and the last link are that a sphere is on.
struct Ends {
  Eigen::Vector3d base, hand;
};

Ends ends_at(const RobotModel& robot, const Eigen::VectorXd& q) {
  const RobotDescription& described = robot.description();
  const auto [first, last] = std::ranges::minmax(described.spheres, {}, &CollisionSphere::link);
  std::vector<Transform> T_world_link(described.links.size());
  Scratch scratch;
  robot.link_poses(as_span(q), T_world_link, scratch);
  return {T_world_link[idx(first.link)].translation(), T_world_link[idx(last.link)].translation()};
}

}  // namespace

StoredArray course_of(const EpisodeRecord& episode, const RobotModel& robot) {
  StoredArray course;
  if (!episode.scene || robot.description().spheres.empty()) return course;
  std::optional<Ends> before;
  double before_s = 0.0;
  for (const auto& [time_s, clearance_m] : episode.truth.clearances) {
    const auto pose = std::ranges::lower_bound(episode.poses, time_s, {}, &TruePose::time_s);
    const Ends now = ends_at(robot, pose->q);
    const auto speed = [&, dt_s = time_s - before_s](Eigen::Vector3d Ends::*end) {
      return before ? (now.*end - (*before).*end).norm() / dt_s : 0.0;
    };
    course.add_row(std::array{time_s, clearance_m, speed(&Ends::base), speed(&Ends::hand)});
    before = now;
    before_s = time_s;
  }
  return course;
}

std::optional<Figure> course_figure(const StoredArray& course, std::int64_t episode,
                                    const Json& collisions) {
  if (course.rows < 2) return std::nullopt;
  constexpr double kWidth = 900.0, kHeight = 150.0, kLegend = 30.0;
  std::array<std::vector<double>, 4> columns;
  for (std::size_t i = 0; i < course.values.size(); ++i) {
    columns[i % 4].push_back(course.values[i]);
  }
  const auto& [time_s, clearance_m, base_mps, hand_mps] = columns;
  const std::string name = std::to_string(episode);
  Figure figure{
      "episode-" + name + "-course",
      "Episode " + name +
          ": distance from what truly was nearest, the floor aside, and speed of base and "
          "hand.",
      Canvas(kWidth, 2.0 * kHeight + kLegend)};
  const Range span{time_s.front(), time_s.back()};
  Range distance{0.0, 0.1};
  for (const double clearance : clearance_m) distance.include(clearance);
  Range speed{0.0, 0.01};
  for (const double mps : base_mps) speed.include(mps);
  for (const double mps : hand_mps) speed.include(mps);
  Axes above(figure.canvas, {90.0, 0.0, kWidth - 90.0, kHeight}, span, distance.padded(0.05),
             {"", "", "distance [m]"});
  Axes below(figure.canvas, {90.0, kHeight, kWidth - 90.0, kHeight}, span, speed.padded(0.05),
             {"", "time [s]", "speed [m/s]"});
  const Stroke own{palette::kVermilion, 1.4, {}}, others{palette::kOrange, 1.4, {}};
  for (Axes* const axes : {&above, &below}) {
    axes->grid();
    for (const Json& contact : collisions) {
      if (contact.at("episode") != episode) continue;
      axes->vertical(contact.at("time_s"), contact.at("by") == "robot" ? own : others);
    }
  }
  const Stroke nearest{palette::kGreen, 1.4, {}}, base{palette::kBlue, 1.4, {}},
      hand{palette::kSky, 1.0, {}};
  above.line(time_s, clearance_m, nearest);
  below.line(time_s, hand_mps, hand);
  below.line(time_s, base_mps, base);
  above.finish();
  below.finish();
  using Mark = LegendEntry::Mark;
  draw_legend(figure.canvas, {94.0, 2.0 * kHeight + 4.0}, kWidth - 94.0,
              {{"distance", Mark::kLine, nearest},
               {"base", Mark::kLine, base},
               {"hand", Mark::kLine, hand},
               {"contact by the robot", Mark::kLine, own},
               {"contact by others", Mark::kLine, others}});
  return figure;
}

}  // namespace sidestep
