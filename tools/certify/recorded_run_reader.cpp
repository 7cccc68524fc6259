#include "bag_reader.hpp"
#include "motion_reader.hpp"
#include "run_bag.hpp"

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

double seconds(ros::Time time) { return time.sec + 1e-9 * time.nsec; }
double seconds(ros::Duration time) { return time.sec + 1e-9 * time.nsec; }

/// What the bag of a run holds on one topic, in order. Fails where it is not all there.
template <class Message>
Result<std::vector<Message>> messages_of(const std::filesystem::path& file, const char* topic) {
  auto bag = SIDESTEP_TRY(bag::Reader::open(file));
  if (bag.damage()) return tl::make_unexpected(*bag.damage());
  bag.select({topic});
  std::vector<Message> messages;
  while (const auto message = SIDESTEP_TRY(bag.next())) {
    messages.push_back(SIDESTEP_TRY(ros::parse<Message>(message->data)));
  }
  if (!messages.empty()) return messages;
  return fail(ErrorCode::kConfig, std::string("holds nothing on ") + topic, file.string());
}

}  // namespace

Result<std::vector<NamedSamples>> read_recorded_motions(const std::filesystem::path& file,
                                                        const RobotDescription& robot) {
  std::vector<NamedSamples> motions;
  for (const auto& message :
       SIDESTEP_TRY(messages_of<ros::JointTrajectory>(file, topics::kTrajectory))) {
    NamedSamples motion{format("%s#%zu", file.c_str(), motions.size() + 1), {}};
    const std::string where =
        motion.name + format(" at %.3f s", seconds(message.header.stamp) -
                                               1e-9 * static_cast<double>(kRosEpoch.ns));
    const auto order = SIDESTEP_TRY(
        joint_order(message.joint_names, robot, [&](auto) { return std::string(where); }));
    motion.samples.has_velocities = true;
    for (const ros::JointTrajectoryPoint& point : message.points) {
      if (point.positions.size() != order.size() || point.velocities.size() != order.size()) {
        return fail(ErrorCode::kConfig, "a state lacks a joint", where);
      }
      MotionSamples::State state(order.size());
      for (std::size_t i = 0; i < order.size(); ++i) {
        state[order[i]] = {point.positions[i], point.velocities[i], 0.0};
      }
      if (!motion.samples.add(seconds(point.time_from_start), std::move(state))) {
        return fail(ErrorCode::kConfig, "time does not go on", where);
      }
    }
    if (motion.samples.states.size() > 1) motions.push_back(std::move(motion));
  }
  return motions;
}

Result<Swarm> read_recorded_map(const std::filesystem::path& file) {
  const auto maps = SIDESTEP_TRY(messages_of<ros::MarkerArray>(file, topics::kMap));
  Swarm swarm{file.filename().string(), Swarm::Kind::kCubes, {}};
  for (const ros::Marker& marker : maps.back().markers) {
    if (marker.type != ros::Marker::kCubeList || marker.action != ros::Marker::kAdd) continue;
    for (const ros::Point& p : marker.points) {
      swarm.members.push_back({{p.x, p.y, p.z}, marker.scale.x});
    }
  }
  return swarm;
}

}  // namespace sidestep
