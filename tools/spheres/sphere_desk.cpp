#include "sphere_desk.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

#include <sidestep/core/index.hpp>

#include "cover_fit.hpp"
#include "view_message.hpp"
#include "view_messages.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;
using Spheres = std::vector<CollisionSphere>;

/// The first named pose, 0 or the limit nearest to it for joints that it leaves out.
Eigen::VectorXd pose_of(const RobotDescription& robot) {
  Eigen::VectorXd q(robot.dof());
  for (int j = 0; j < robot.dof(); ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Joint& joint = robot.joints[at];
    q[j] = std::clamp(0.0, joint.lower, joint.upper);
    if (!robot.poses.empty()) q[j] = robot.poses.front().positions[at].value_or(q[j]);
  }
  return q;
}

std::optional<double> number(const Json& json, const char* key, double least, double most) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  if (!(value >= least && value <= most)) return std::nullopt;
  return value;
}

std::optional<int> whole(const Json& json, const char* key, int least, int most) {
  const auto found = json.find(key);
  if (found == json.end() || !found->is_number_integer()) return std::nullopt;
  if (!number(json, key, least, most)) return std::nullopt;
  return found->get<int>();
}

std::optional<CollisionSphere> read_sphere(const Json& json, int links) {
  constexpr double kMost_m = 100.0;
  if (!json.is_object() || json.size() != 3) return std::nullopt;
  const auto link = whole(json, "link", 0, links - 1);
  const auto radius = number(json, "radius_m", 1e-6, kMost_m);
  const auto centre = json.find("centre_m");
  if (!link || !radius || centre == json.end() || !centre->is_array() || centre->size() != 3) {
    return std::nullopt;
  }
  CollisionSphere sphere{*link, Eigen::Vector3d::Zero(), *radius};
  for (int axis = 0; axis < 3; ++axis) {
    const Json& value = (*centre)[static_cast<std::size_t>(axis)];
    if (!value.is_number() || !(std::abs(value.get<double>()) <= kMost_m)) return std::nullopt;
    sphere.centre_link_m[axis] = value.get<double>();
  }
  return sphere;
}

std::optional<Spheres> read_spheres(const Json& json, int links) {
  const auto list = json.find("spheres");
  if (list == json.end() || !list->is_array() || list->size() > FitGoal::kMostSpheres) {
    return std::nullopt;
  }
  Spheres spheres;
  for (const Json& item : *list) {
    const auto sphere = read_sphere(item, links);
    if (!sphere) return std::nullopt;
    spheres.push_back(*sphere);
  }
  return spheres;
}

std::optional<FitGoal> read_goal(const Json& json, int links) {
  const auto goal = json.find("fit");
  if (goal == json.end() || !goal->is_object()) return std::nullopt;
  FitGoal read;
  const auto protrusion =
      number(*goal, "protrusion_m", FitGoal::kLeastProtrusion_m, FitGoal::kMostProtrusion_m);
  read.most_spheres = whole(*goal, "count", 1, FitGoal::kMostSpheres);
  read.link = whole(*goal, "link", 0, links - 1);
  if (protrusion.has_value() == read.most_spheres.has_value()) return std::nullopt;
  if (goal->size() != (read.link ? 2U : 1U)) return std::nullopt;
  read.protrusion_m = protrusion.value_or(read.protrusion_m);
  return read;
}

Json share_json(const Cover& cover) {
  return {{"spheres", cover.spheres},           {"surface_share", cover.surface_share},
          {"volume_share", cover.volume_share}, {"gap_m", cover.gap_m},
          {"protrusion_m", cover.protrusion_m}, {"shapes_m3", cover.shapes_m3},
          {"spheres_m3", cover.spheres_m3},     {"excess_m3", cover.excess_m3}};
}

Json spheres_json(const Spheres& spheres) {
  Json list = Json::array();
  for (const CollisionSphere& one : spheres) {
    list.push_back({{"link", one.link},
                    {"centre_m", point_json(one.centre_link_m)},
                    {"radius_m", one.radius_m}});
  }
  return list;
}

}  // namespace

Json cover_json(const RobotCover& cover) {
  Json links = Json::array();
  for (const LinkCover& one : cover.links) {
    Json link = {{"link", one.link}};
    link.update(share_json(one.cover));
    links.push_back(std::move(link));
  }
  return {{"links", std::move(links)}, {"whole", share_json(cover.whole)}};
}

SphereDesk::SphereDesk(SphereProfile& profile)
    : profile_(profile), bodies_(rigid_bodies(*profile.robot())) {}

std::vector<ViewMessage> SphereDesk::greeting() {
  const KinematicTree& robot = *profile_.robot();
  ObservedWorld world;
  world.title = profile_.target().string();
  world.robot = profile_.robot();
  world.q_start = world.q_goal = pose_of(robot.description());
  ObservedStep step;
  step.q = world.q_start;
  const RobotCover cover = measure_cover(bodies_, robot.description().spheres);
  return {world_message(world),
          state_message(step, link_poses(robot, as_span(step.q)), {}, std::nullopt),
          make_message(ViewKind::kProfile, Stamp{},
                       {{"file", profile_.target().string()},
                        {"revision", profile_.revision()},
                        {"cover", cover_json(cover)}})};
}

std::optional<ViewMessage> SphereDesk::answer(std::string_view text, const std::stop_token& stop) {
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  const int links = static_cast<int>(profile_.robot()->description().links.size());
  const auto request = whole(json, "request", 0, 1 << 30);
  auto spheres = read_spheres(json, links);
  if (!request || !spheres) return std::nullopt;
  Json reply = {{"request", *request}};
  if (json.size() == 3 && json.contains("fit")) {
    const auto goal = read_goal(json, links);
    if (!goal) return std::nullopt;
    spheres = fit_cover(bodies_, *spheres, *goal, stop);
    reply["spheres"] = spheres_json(*spheres);
    reply["cover"] = cover_json(measure_cover(bodies_, *spheres));
  } else if (json.size() == 3 && json.contains("save") && json["save"].is_string()) {
    // What the page has seen of the file must be what there is.
    const bool is_current = json["save"].get_ref<const std::string&>() == profile_.revision();
    const auto saved = is_current ? profile_.save(*spheres)
                                  : fail(ErrorCode::kIo, "another page has saved meanwhile",
                                         profile_.target().string(), "load this page again");
    if (saved) {
      reply["saved"] = profile_.revision();
    } else {
      reply["refused"] = saved.error().describe();
    }
  } else if (json.size() == 2) {
    reply["cover"] = cover_json(measure_cover(bodies_, *spheres));
  } else {
    return std::nullopt;
  }
  return make_message(ViewKind::kReply, Stamp{}, std::move(reply));
}

}  // namespace sidestep
