#pragma once

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

namespace sidestep::testing_support {

/// A message to the page, read as docs/reference/viewer.md says, byte by byte.
struct DecodedMessage {
  nlohmann::json header;
  std::string payload;

  explicit DecodedMessage(const std::string& bytes) {
    if (bytes.size() < 4) throw std::runtime_error("no length");
    std::size_t length = 0;
    for (std::size_t i = 4; i-- > 0;) length = length << 8 | static_cast<unsigned char>(bytes[i]);
    std::size_t at = 4 + length;
    if (at > bytes.size()) throw std::runtime_error("header beyond the end");
    header = nlohmann::json::parse(bytes.substr(4, length));
    for (; at % 4 != 0; ++at) {
      if (bytes.at(at) != '\0') throw std::runtime_error("padding is not zero");
    }
    payload = bytes.substr(at);
  }

  [[nodiscard]] std::string kind() const { return header.at("kind"); }
  [[nodiscard]] std::uint64_t unsigned_at(std::size_t byte, std::size_t size) const {
    std::uint64_t value = 0;
    for (std::size_t i = size; i-- > 0;) {
      value = value << 8 | static_cast<unsigned char>(payload.at(byte + i));
    }
    return value;
  }
  [[nodiscard]] std::uint16_t u16(std::size_t index) const {
    return static_cast<std::uint16_t>(unsigned_at(2 * index, 2));
  }
  [[nodiscard]] std::int16_t i16(std::size_t index) const {
    const int value = u16(index);
    return static_cast<std::int16_t>(value >= 0x8000 ? value - 0x10000 : value);
  }
  [[nodiscard]] float f32(std::size_t index) const {
    const auto bits = static_cast<std::uint32_t>(unsigned_at(4 * index, 4));
    float value = 0.0F;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
  }
  /// Bit i of a run of bits that begins at `byte`.
  [[nodiscard]] bool bit(std::size_t byte, std::size_t i) const {
    return (static_cast<unsigned char>(payload.at(byte + i / 8)) >> (i % 8) & 1) != 0;
  }
};

/// The map as a page keeps it: what its messages told so far, voxel by voxel.
class DecodedMap {
 public:
  void apply(const DecodedMessage& message) {
    const auto& header = message.header;
    const auto size = header.at("size_vox").get<std::vector<int>>();
    if (header.at("full").get<bool>()) {
      size_ = size;
      voxels_.assign(static_cast<std::size_t>(size[0]) * size[1] * size[2], 0);
    } else if (size != size_) {
      throw std::runtime_error("another grid without `full`");
    }
    const int nx = (size[0] + 15) / 16, ny = (size[1] + 15) / 16;
    std::size_t byte = 0;
    for (const int block : header.at("blocks").get<std::vector<int>>()) {
      const int bx = block % nx, by = block / nx % ny, bz = block / (nx * ny);
      for (int i = 0; i < 4096; ++i) {
        const int x = 16 * bx + i % 16, y = 16 * by + i / 16 % 16, z = 16 * bz + i / 256;
        const bool occupied = message.bit(byte, static_cast<std::size_t>(i));
        const bool known = message.bit(byte + 512, static_cast<std::size_t>(i));
        if (x >= size[0] || y >= size[1] || z >= size[2]) {
          if (occupied || known) throw std::runtime_error("a bit beyond the grid");
          continue;
        }
        voxels_[index(x, y, z)] = static_cast<char>((occupied ? 1 : 0) | (known ? 2 : 0));
      }
      byte += 1024;
    }
    if (byte != message.payload.size()) throw std::runtime_error("payload of another size");
  }

  [[nodiscard]] bool occupied(int x, int y, int z) const { return voxels_[index(x, y, z)] & 1; }
  [[nodiscard]] bool known(int x, int y, int z) const { return voxels_[index(x, y, z)] & 2; }

 private:
  [[nodiscard]] std::size_t index(int x, int y, int z) const {
    return static_cast<std::size_t>(x + size_[0] * (y + size_[1] * z));
  }
  std::vector<int> size_;
  std::vector<char> voxels_;
};

}  // namespace sidestep::testing_support
