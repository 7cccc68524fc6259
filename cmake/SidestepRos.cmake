# What of ROS 1 is installed, without ROS's own CMake files: on Debian 12 they look for a Python that is
# not there. A ROS of one's own (/opt/ros/noetic) is found through CMAKE_PREFIX_PATH.
#
# Sidestep::ros1_messages    the messages of cameras, transforms and joints, and how to read them
# Sidestep::ros1_bag_writer  ROS's own library for bags, with which tests write them
# SIDESTEP_ROS_PACKAGES      what to install where the first is missing

option(SIDESTEP_ROS "Build what needs ROS 1, where that is installed" ON)
set(SIDESTEP_ROS_PACKAGES libroscpp-core-dev libsensor-msgs-dev libnav-msgs-dev libtf2-msgs-dev)
if(NOT SIDESTEP_ROS)
  return()
endif()

# sidestep_find_ros(TARGET HEADERS header... LIBRARIES library...)
# The imported target TARGET, if all of it is there.
function(sidestep_find_ros target)
  cmake_parse_arguments(ARG "" "" "HEADERS;LIBRARIES" ${ARGN})
  set(folders "")
  set(libraries "")
  foreach(header IN LISTS ARG_HEADERS)
    # pluginlib and what it uses lie one folder deeper than they are included from.
    string(REGEX REPLACE "/.*" "" package ${header})
    find_path(SIDESTEP_ROS_INCLUDE_${package} ${header} PATH_SUFFIXES ${package})
    mark_as_advanced(SIDESTEP_ROS_INCLUDE_${package})
    if(NOT SIDESTEP_ROS_INCLUDE_${package})
      return()
    endif()
    list(APPEND folders ${SIDESTEP_ROS_INCLUDE_${package}})
  endforeach()
  foreach(library IN LISTS ARG_LIBRARIES)
    find_library(SIDESTEP_ROS_LIBRARY_${library} ${library})
    mark_as_advanced(SIDESTEP_ROS_LIBRARY_${library})
    if(NOT SIDESTEP_ROS_LIBRARY_${library})
      return()
    endif()
    list(APPEND libraries ${SIDESTEP_ROS_LIBRARY_${library}})
  endforeach()
  list(REMOVE_DUPLICATES folders)
  list(REMOVE_ITEM folders ${CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES})
  add_library(${target} INTERFACE IMPORTED GLOBAL)
  target_include_directories(${target} SYSTEM INTERFACE ${folders})
  target_link_libraries(${target} INTERFACE ${libraries})
endfunction()

sidestep_find_ros(Sidestep::ros1_messages
  HEADERS
    ros/serialization.h geometry_msgs/TransformStamped.h nav_msgs/Odometry.h sensor_msgs/Image.h
    std_msgs/Header.h tf2_msgs/TFMessage.h
  LIBRARIES roscpp_serialization rostime cpp_common)
if(NOT TARGET Sidestep::ros1_messages)
  return()
endif()
sidestep_find_ros(Sidestep::ros1_bag_writer
  HEADERS
    rosbag/bag.h ament_index_cpp/get_resource.hpp class_loader/class_loader.hpp
    console_bridge/console.h pluginlib/class_loader.hpp rcpputils/shared_library.hpp
    rcutils/types.h
  LIBRARIES rosbag_storage roslz4 console_bridge class_loader ament_index_cpp rcutils)
