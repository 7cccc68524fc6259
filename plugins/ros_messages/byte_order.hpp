#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

namespace sidestep::ros_messages {

/// Whether numbers of that byte order must be turned round here.
[[nodiscard]] constexpr bool is_foreign(bool is_bigendian) noexcept {
  return is_bigendian != (std::endian::native == std::endian::big);
}

[[nodiscard]] inline std::uint16_t turned_round(std::uint16_t raw) noexcept {
  return __builtin_bswap16(raw);
}
[[nodiscard]] inline std::uint32_t turned_round(std::uint32_t raw) noexcept {
  return __builtin_bswap32(raw);
}
[[nodiscard]] inline std::uint64_t turned_round(std::uint64_t raw) noexcept {
  return __builtin_bswap64(raw);
}

/// An unsigned number at any address.
template <class Raw>
[[nodiscard]] Raw read_raw(const std::uint8_t* from, bool swapped) noexcept {
  Raw raw;
  std::memcpy(&raw, from, sizeof raw);
  return swapped ? turned_round(raw) : raw;
}

}  // namespace sidestep::ros_messages
