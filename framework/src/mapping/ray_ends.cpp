#include <sidestep/mapping/ray_ends.hpp>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>

#include <sidestep/core/index.hpp>
#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/mapping/self_filter.hpp>

namespace sidestep {
namespace {

constexpr double kRigidTolerance = 1e-3;

const char* pose_fault(const Transform& pose) {
  if (!pose.matrix().allFinite()) return "its camera pose is not finite";
  const Eigen::Matrix3d rotation = pose.linear();
  const double skew =
      (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (skew > kRigidTolerance)
    return "its camera pose is not rigid: the rotation is not orthonormal";
  if (rotation.determinant() < 0.0) return "its camera pose is not rigid: it mirrors";
  return nullptr;
}

std::string image_fault(const DepthImage& image) {
  const CameraIntrinsics& camera = image.camera;
  const std::string size =
      std::to_string(camera.width_px) + " x " + std::to_string(camera.height_px);
  if (camera.width_px <= 0 || camera.height_px <= 0) {
    return "its depth image is " + size + " pixels";
  }
  for (const double focal_px : {camera.fx_px, camera.fy_px}) {
    if (!std::isfinite(focal_px) || focal_px <= 0.0) {
      return "its focal length is " + std::to_string(focal_px) + " px";
    }
  }
  if (!std::isfinite(camera.cx_px) || !std::isfinite(camera.cy_px)) {
    return "its principal point is not finite";
  }
  const std::size_t pixels = idx(camera.width_px) * idx(camera.height_px);
  if (image.depth_m.size() != pixels) {
    return "it has " + std::to_string(image.depth_m.size()) + " depths for a camera of " + size +
           " pixels";
  }
  return {};
}

}  // namespace

Error bad_frame(const Frame& frame, std::string message, std::string hint) {
  return Error{ErrorCode::kBadFrame, std::move(message), "frame " + std::to_string(frame.sequence),
               std::move(hint), nullptr};
}

Result<void> check_frame(const Frame& frame) {
  if (const char* fault = pose_fault(frame.T_world_camera)) {
    return tl::make_unexpected(bad_frame(frame, fault));
  }
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    std::string fault = image_fault(*image);
    if (!fault.empty()) return tl::make_unexpected(bad_frame(frame, std::move(fault)));
  }
  return {};
}

Result<void> SelfFilter::pose(const Frame& frame) {
  balls_.clear();
  if (!robot_ || !frame.joint_positions) return {};
  const RobotDescription& robot = robot_->description();
  const Eigen::VectorXd& q = *frame.joint_positions;
  if (q.size() != robot.dof()) {
    return tl::make_unexpected(
        bad_frame(frame, "it has " + std::to_string(q.size()) + " joint positions, but robot '" +
                             robot.name + "' has " + std::to_string(robot.dof()) + " joints"));
  }
  if (!q.allFinite()) {
    return tl::make_unexpected(bad_frame(frame, "a joint position is not finite"));
  }
  centres_m_.resize(robot.spheres.size());
  robot_->sphere_centres(as_span(q), centres_m_, scratch_);
  for (std::size_t s = 0; s < centres_m_.size(); ++s) {
    balls_.push_back({centres_m_[s], robot.spheres[s].radius_m + margin_m_});
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(balls_[s].radius_m);
    const Eigen::Vector3d lower = centres_m_[s] - reach;
    const Eigen::Vector3d upper = centres_m_[s] + reach;
    lower_m_ = s == 0 ? lower : Eigen::Vector3d(lower_m_.cwiseMin(lower));
    upper_m_ = s == 0 ? upper : Eigen::Vector3d(upper_m_.cwiseMax(upper));
  }
  return {};
}

bool SelfFilter::contains(const Eigen::Vector3d& p_world) const noexcept {
  if (balls_.empty() || (p_world.array() < lower_m_.array()).any() ||
      (p_world.array() > upper_m_.array()).any()) {
    return false;
  }
  for (const Ball& ball : balls_) {
    if ((p_world - ball.centre_m).squaredNorm() <= ball.radius_m * ball.radius_m) return true;
  }
  return false;
}

std::optional<LinePart> clip_to_box(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                    const Eigen::Vector3d& size) {
  LinePart part;
  for (int axis = 0; axis < 3; ++axis) {
    const double along = to[axis] - from[axis];
    if (along == 0.0) {
      if (from[axis] < 0.0 || from[axis] >= size[axis]) return std::nullopt;
      continue;
    }
    const double a = -from[axis] / along;
    const double b = (size[axis] - from[axis]) / along;
    part.enter = std::max(part.enter, std::min(a, b));
    part.leave = std::min(part.leave, std::max(a, b));
  }
  if (part.enter >= part.leave) return std::nullopt;
  return part;
}

Eigen::Vector3i nearest_voxel(const GridSpec& grid, const Eigen::Vector3d& p_vox) {
  const Eigen::Array3d last = grid.size_vox.cast<double>().array() - 1.0;
  return p_vox.array().floor().max(0.0).min(last).cast<int>().matrix();
}

RayEnds::RayEnds(const GridSpec& grid, const PointRules& rules, bool clear_no_return,
                 const SelfFilter& self, const Frame& frame)
    : grid_(grid), rules_(rules), clear_no_return_(clear_no_return), self_(self), frame_(frame) {}

std::size_t RayEnds::size() const noexcept {
  const auto* image = std::get_if<DepthImage>(&frame_.measurement);
  return image != nullptr ? image->depth_m.size()
                          : std::get_if<PointCloud>(&frame_.measurement)->points_m.size();
}

Eigen::Vector3d RayEnds::to_vox(const Eigen::Vector3d& p_world) const {
  return (p_world - grid_.origin_m) / grid_.resolution_m;
}

Eigen::Vector3d RayEnds::camera_vox() const { return to_vox(frame_.T_world_camera.translation()); }

std::optional<RayEnd> RayEnds::at(std::size_t index, IntegrationCounts& counts) const {
  const auto* image = std::get_if<DepthImage>(&frame_.measurement);
  if (image == nullptr) {
    const PointCloud& cloud = *std::get_if<PointCloud>(&frame_.measurement);
    return of_point(cloud.points_m[index].cast<double>(), counts);
  }
  const CameraIntrinsics& camera = image->camera;
  const std::size_t width = idx(camera.width_px);
  const double u = static_cast<double>(index % width);
  const std::size_t row = index / width;
  const double v = static_cast<double>(row);
  const float depth_m = image->depth_m[index];
  if (depth_m > 0.0F) {
    return of_point(camera.unproject(u, v, static_cast<double>(depth_m)), counts);
  }
  ++counts.invalid;
  if (!clear_no_return_ || depth_m != 0.0F) return std::nullopt;
  const Eigen::Vector3d ray = camera.unproject(u, v, 1.0).normalized();
  return free_to(frame_.T_world_camera * Eigen::Vector3d(ray * rules_.max_range_m));
}

std::optional<RayEnd> RayEnds::of_point(const Eigen::Vector3d& p_camera,
                                        IntegrationCounts& counts) const {
  const Eigen::Vector3d p_world = frame_.T_world_camera * p_camera;
  const PointFate fate = rules_.fate(p_camera, p_world);
  if (fate == PointFate::kInvalid) {
    ++counts.invalid;
    return std::nullopt;
  }
  ++counts.points;
  if (self_.contains(p_world)) {
    ++counts.self;
    return std::nullopt;
  }
  if (fate == PointFate::kFloor) {
    ++counts.floor;
    return free_to(p_world);
  }
  const Eigen::Vector3d& eye_world = frame_.T_world_camera.translation();
  if (fate == PointFate::kOutOfRange) {
    ++counts.out_of_range;
    return free_to(eye_world + rules_.max_range_m / p_camera.norm() * (p_world - eye_world));
  }
  const Eigen::Vector3d p_vox = to_vox(p_world);
  if ((p_vox.array() >= 0.0).all() &&
      (p_vox.array() < grid_.size_vox.cast<double>().array()).all()) {
    ++counts.inserted;
    return RayEnd{p_vox, true};
  }
  ++counts.outside_grid;
  return free_to(p_world);
}

std::optional<RayEnd> RayEnds::free_to(const Eigen::Vector3d& p_world) const {
  const Eigen::Vector3d from = camera_vox();
  const Eigen::Vector3d to = to_vox(p_world);
  const auto part = clip_to_box(from, to, grid_.size_vox.cast<double>());
  if (!part) return std::nullopt;
  return RayEnd{from + part->leave * (to - from), false};
}

void add_counts(IntegrationCounts& to, const IntegrationCounts& more) noexcept {
  to.points += more.points;
  to.inserted += more.inserted;
  to.floor += more.floor;
  to.self += more.self;
  to.out_of_range += more.out_of_range;
  to.outside_grid += more.outside_grid;
  to.invalid += more.invalid;
}

}  // namespace sidestep
