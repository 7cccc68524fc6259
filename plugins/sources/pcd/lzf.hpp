#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace sidestep::pcd {

/// Unpacks LZF (M. Lehmann's liblzf), the compression of binary_compressed point clouds, into
/// exactly `size` bytes. Nothing where the data are damaged or unpack to another size.
[[nodiscard]] std::optional<std::vector<std::uint8_t>> unpack_lzf(
    std::span<const std::uint8_t> packed, std::size_t size);

}  // namespace sidestep::pcd
