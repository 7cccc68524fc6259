# The ROS 1 client library, for the plugins that talk to a robot; after SidestepRos.
#
# Sidestep::roscpp               roscpp and the messages of motion, goals and markers
# SIDESTEP_ROSCPP_PACKAGES       what to install where it is missing

set(SIDESTEP_ROSCPP_PACKAGES
  libroscpp-dev libsensor-msgs-dev libnav-msgs-dev libtf2-msgs-dev libtrajectory-msgs-dev
  libvisualization-msgs-dev libactionlib-msgs-dev)
if(NOT TARGET Sidestep::ros1_messages)
  return()
endif()

sidestep_find_ros(Sidestep::roscpp
  HEADERS
    ros/ros.h actionlib_msgs/GoalStatus.h rosgraph_msgs/Clock.h std_msgs/Bool.h sensor_msgs/BatteryState.h
    trajectory_msgs/JointTrajectory.h visualization_msgs/MarkerArray.h
  LIBRARIES roscpp rosconsole xmlrpcpp roscpp_serialization rostime cpp_common boost_thread)
