#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/geometry/transform.hpp>

#include "view_message.hpp"

namespace sidestep {

static_assert(std::endian::native == std::endian::little, "numbers travel as they lie in memory");

/// The payload of a message, number by number.
class Payload {
 public:
  template <class Number>
  void add(std::span<const Number> numbers) {
    static_assert(std::is_arithmetic_v<Number>);
    const std::size_t size = bytes_.size();
    bytes_.resize(size + numbers.size_bytes());
    if (!numbers.empty()) std::memcpy(bytes_.data() + size, numbers.data(), numbers.size_bytes());
  }
  void add(const Eigen::Vector3d& p) {
    const Eigen::Vector3f single = p.cast<float>();
    add(std::span<const float>(single.data(), 3));
  }
  /// x, y, z, qx, qy, qz, qw.
  void add(const Transform& pose) {
    add(Eigen::Vector3d(pose.translation()));
    const Eigen::Quaternionf turn = Eigen::Quaterniond(pose.linear()).cast<float>();
    add(std::span<const float>(turn.coeffs().data(), 4));
  }
  void reserve(std::size_t bytes) { bytes_.reserve(bytes); }
  [[nodiscard]] const std::string& bytes() const noexcept { return bytes_; }

 private:
  std::string bytes_;
};

/// Header and payload, as they travel. `header` is without `kind` and `time_s`.
[[nodiscard]] ViewMessage make_message(ViewKind kind, Stamp time, nlohmann::ordered_json header,
                                       const Payload& payload = {});

[[nodiscard]] nlohmann::ordered_json point_json(const Eigen::Vector3d& p);
[[nodiscard]] nlohmann::ordered_json pose_json(const Transform& pose);

}  // namespace sidestep
