#include "lzf.hpp"

namespace sidestep::pcd {
namespace {

constexpr std::size_t kLongestCopy = 264;

}  // namespace

std::optional<std::vector<std::uint8_t>> unpack_lzf(std::span<const std::uint8_t> packed,
                                                    std::size_t size) {
  // Before anything is allocated for a size that a damaged file made up.
  if (size / kLongestCopy > packed.size()) return std::nullopt;
  std::vector<std::uint8_t> out;
  out.reserve(size);
  std::size_t at = 0;
  while (at < packed.size()) {
    const std::size_t control = packed[at++];
    if (control < 32) {  // control + 1 bytes as they are
      const std::size_t length = control + 1;
      if (length > packed.size() - at || length > size - out.size()) return std::nullopt;
      for (std::size_t i = 0; i < length; ++i) out.push_back(packed[at++]);
      continue;
    }
    // A copy of what came `distance` bytes before; it may overlap itself.
    std::size_t length = control >> 5;
    if (length == 7) {
      if (at == packed.size()) return std::nullopt;
      length += packed[at++];
    }
    length += 2;
    if (at == packed.size()) return std::nullopt;
    const std::size_t distance = ((control & 31) << 8 | packed[at++]) + 1;
    if (distance > out.size() || length > size - out.size()) return std::nullopt;
    for (std::size_t i = 0; i < length; ++i) out.push_back(out[out.size() - distance]);
  }
  if (out.size() != size) return std::nullopt;
  return out;
}

}  // namespace sidestep::pcd
