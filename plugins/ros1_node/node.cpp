#include "node.hpp"

#include <chrono>
#include <cstdlib>
#include <thread>

#include <ros/init.h>
#include <ros/time.h>

namespace sidestep::ros1_node {

Result<MasterProbe> join_ros(double patience_s, double probe_period_s, const std::string& name) {
  const char* const uri = std::getenv("ROS_MASTER_URI");
  if (uri == nullptr) {
    return fail(ErrorCode::kConfig, "ROS_MASTER_URI is not set", "environment",
                "export ROS_MASTER_URI=http://ROBOT:11311");
  }
  const auto address = SIDESTEP_TRY(parse_master_uri(uri));
  auto probe = SIDESTEP_TRY(MasterProbe::create(address, probe_period_s));
  while (!probe.has_answered() && probe.silence_s() < patience_s) {
    probe.poll();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (!probe.has_answered()) {
    return fail(ErrorCode::kNotFound, std::string("no ROS master answers at ROS_MASTER_URI=") + uri,
                "environment", "start the robot or a rosmaster, or export another ROS_MASTER_URI");
  }
  if (!::ros::isInitialized()) {
    ::ros::init(::ros::M_string(), name,
                ::ros::init_options::NoSigintHandler | ::ros::init_options::AnonymousName);
  }
  // Started here, ROS is not shut down with the last handle of one plugin.
  if (!::ros::isStarted()) ::ros::start();
  // With use_sim_time there is none before the first message on /clock.
  (void)::ros::Time::waitForValid(::ros::WallDuration(patience_s));
  return probe;
}

}  // namespace sidestep::ros1_node
