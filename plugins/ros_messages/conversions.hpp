#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/sensing/frame.hpp>

#include "histories.hpp"
#include "messages.hpp"

/// ROS messages as Sidestep's data, and the reverse. Every function: [any] thread. Failures are
/// kBadFrame and say what is wrong with the message, without naming its topic.
namespace sidestep::ros_messages {

/// A failure with kBadFrame.
[[nodiscard]] inline tl::unexpected<Error> bad_message(std::string message, std::string hint = {}) {
  return fail(ErrorCode::kBadFrame, std::move(message), {}, std::move(hint));
}

[[nodiscard]] Stamp to_stamp(const ::ros::Time& time) noexcept;
/// Times before 1970 or after 2106, which ROS cannot write, become the nearest that it can.
[[nodiscard]] ::ros::Time to_ros_time(Stamp stamp);

/// Depths outside of these count as no return.
struct DepthRange {
  double min_m = 0.0;
  double max_m = 10.0;
};

/// How images tell depth (REP 118): in mm as unsigned 16-bit, or in m as float.
enum class DepthEncoding : std::uint8_t { k16UC1, k32FC1 };

/// What a pixel of a rectified image sees. Of the projection matrix P where it is set, else of K;
/// binning and a region of interest are taken into account. Fails where sizes or focal lengths are
/// not positive and finite.
[[nodiscard]] Result<CameraIntrinsics> intrinsics(const CameraInfo& info);
/// Whether pixels of the image do not see along straight lines: distorted, with no P to undo it.
[[nodiscard]] bool is_distorted(const CameraInfo& info);

/// A depth image of encoding 16UC1 or mono16 (mm) or 32FC1 (m), of either byte order, rows padded
/// or not. 0 mm and +inf are no return; 65535 mm, NaN, -inf and negative depths are invalid. Fails
/// where the image has another encoding or another size than `camera`, or fewer bytes than it says.
[[nodiscard]] Result<DepthImage> depth_image(const Image& message, const CameraIntrinsics& camera,
                                             const DepthRange& range);

/// The points of a cloud that are finite, in the cloud's own frame and order: fields x, y and z of
/// 32- or 64-bit floats at any offset, of either byte order, organised or not. Fails where there
/// are none such, or fewer bytes than the cloud says.
[[nodiscard]] Result<PointCloud> point_cloud(const PointCloud2& message);

/// One point a beam of a scan, in the laser's own frame (x forward, z up); NaN where the range is
/// not one that the laser measures. All beams count as taken at the stamp. Fails where the angles
/// are not finite.
[[nodiscard]] Result<PointCloud> laser_scan(const LaserScan& message);

/// Nothing where the figures are no rigid transform.
[[nodiscard]] std::optional<RigidPose> pose_of(const TransformStamped& message);
[[nodiscard]] std::optional<RigidPose> pose_of(const PoseStamped& message);
[[nodiscard]] std::optional<RigidPose> pose_of(const Odometry& message);

/// Adds what a message tells; how many of its transforms could not be used: no rotation, a frame
/// without name or below itself, or at a time that the frame has a transform of.
int add_transforms(const TfMessage& message, bool is_static, TfTree& tree);
/// Adds the positions that a message tells, as far as it has a position for every name; how many
/// could not be used.
int add_joint_states(const JointState& message, JointHistory& history);

/// The image as a message; what is no measurement stays that. mm are rounded to the nearest, depths
/// beyond 65.534 m are written as no return.
[[nodiscard]] Image to_image(const DepthImage& image, DepthEncoding encoding, Stamp stamp,
                             const std::string& frame);
[[nodiscard]] CameraInfo to_camera_info(const CameraIntrinsics& camera, Stamp stamp,
                                        const std::string& frame);
/// An unorganised cloud of fields x, y and z.
[[nodiscard]] PointCloud2 to_point_cloud(const PointCloud& cloud, Stamp stamp,
                                         const std::string& frame);
/// Of a scan with beams from `from_rad` to `to_rad`, in steps of the same size; ranges beyond those
/// given are no measurement.
[[nodiscard]] LaserScan to_laser_scan(const PointCloud& scan, double from_rad, double to_rad,
                                      const DepthRange& range, Stamp stamp,
                                      const std::string& frame);
[[nodiscard]] TransformStamped to_transform(const RigidPose& T_parent_child, Stamp stamp,
                                            const std::string& parent, const std::string& child);
/// Positions in the order of `joints`.
[[nodiscard]] JointState to_joint_state(std::span<const Joint> joints,
                                        std::span<const double> positions, Stamp stamp);

}  // namespace sidestep::ros_messages
