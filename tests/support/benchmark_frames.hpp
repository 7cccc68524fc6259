#pragma once

#include <filesystem>
#include <utility>
#include <vector>

#include "support/box_world.hpp"
#include "support/kinect_kitchen.hpp"

namespace sidestep::testing_support {

/// What maps are timed on: the recorded kitchen where it is present, otherwise a rendered room of
/// the same size, along which the camera moves by 1 cm from frame to frame. Link PNG::PNG.
class KitchenOrRoom {
 public:
  explicit KitchenOrRoom(std::filesystem::path shared_data) : kitchen_(std::move(shared_data)) {}

  [[nodiscard]] Frame frame(int number) const {
    if (kitchen_.present()) {
      if (auto frame = kitchen_.frame(number)) return std::move(*frame);
    }
    const BoxWorld room{
        {{{-1, -9, -1}, {9, 9, 0}}, {{3, -9, 0}, {4, 9, 2}}, {{1, -1, 0}, {2, 1, .7}}}};
    const double aside_m = 0.01 * number;
    return room.frame(number, kinect(640, 480), look_at({0, aside_m, 1.5}, {2, aside_m, 0.7}));
  }

  /// Every thirtieth of the kitchen's 300.
  [[nodiscard]] std::vector<Frame> ten_frames() const {
    std::vector<Frame> frames;
    for (int n = 0; n < 300; n += 30) frames.push_back(frame(n));
    return frames;
  }

 private:
  KinectKitchen kitchen_;
};

}  // namespace sidestep::testing_support
