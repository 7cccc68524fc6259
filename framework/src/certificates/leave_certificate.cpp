#include <sidestep/certificates/leave_certificate.hpp>

#include <algorithm>
#include <fstream>

namespace sidestep {

CertifiedScene certified_scene(const ShapeObstacles& obstacles,
                               std::vector<AllowedContact> allowed) {
  std::vector<SceneObject> objects;
  if (obstacles.scene) objects = obstacles.scene->objects();
  if (const auto& floor = obstacles.floor) {
    const Transform T_world_floor(Eigen::Translation3d(0.0, 0.0, floor->height_m));
    objects.push_back({"the floor", HalfSpace{}, {{0.0, T_world_floor}}});
    for (const std::string& link : floor->except_links) allowed.push_back({link, "the floor"});
  }
  CertifiedScene scene{Scene(std::move(objects)), {}, std::move(allowed)};
  if (obstacles.occupied_centres_m.empty()) return scene;
  Swarm& voxels = scene.swarms.emplace_back(Swarm{"occupied voxels", Swarm::Kind::kCubes, {}});
  for (const Eigen::Vector3d& centre_m : obstacles.occupied_centres_m) {
    voxels.members.push_back({centre_m, obstacles.resolution_m});
  }
  return scene;
}

Result<Certification::Outcome> leave_certificate(const RobotModel& robot,
                                                 const ShapeObstacles& obstacles,
                                                 std::vector<AllowedContact> allowed,
                                                 const Trajectory& plan,
                                                 const std::filesystem::path& file) {
  const auto* const tree = dynamic_cast<const KinematicTree*>(&robot);
  if (tree == nullptr) {
    return fail(ErrorCode::kUnsupported, "a certificate needs a robot that tells its joints",
                "check.certificate");
  }
  ShapeObstacles still = obstacles;
  if (still.scene && std::ranges::any_of(still.scene->objects(), &SceneObject::moves)) {
    still.scene = nullptr;
  }
  const auto found = SIDESTEP_TRY(certify(*tree, certified_scene(still, std::move(allowed)),
                                          polynomials_of(plan), {.wants_certificate = true}));
  if (found.outcome != Certification::Outcome::kProven) return found.outcome;
  std::error_code ignored;
  std::filesystem::create_directories(file.parent_path(), ignored);
  std::ofstream out(file);
  out << found.certificate << "\n";
  if (out.flush()) return found.outcome;
  return fail(ErrorCode::kIo, "cannot be written", file.string());
}

}  // namespace sidestep
