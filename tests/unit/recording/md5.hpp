#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <string>

namespace sidestep::testing {

/// The MD5 sum of a text in hexadecimal digits (RFC 1321), plainly.
inline std::string md5(std::string text) {
  constexpr std::array<std::array<int, 4>, 4> kTurns{
      {{7, 12, 17, 22}, {5, 9, 14, 20}, {4, 11, 16, 23}, {6, 10, 15, 21}}};
  const std::uint64_t bits = 8 * text.size();
  text += '\x80';
  while (text.size() % 64 != 56) text += '\0';
  for (int i = 0; i < 8; ++i) text += static_cast<char>(bits >> (8 * i));
  std::array<std::uint32_t, 4> sum{0x67452301, 0xefcdab89, 0x98badcfe, 0x10325476};
  for (std::size_t block = 0; block < text.size(); block += 64) {
    auto [a, b, c, d] = sum;
    for (unsigned i = 0; i < 64; ++i) {
      const unsigned round = i / 16;
      const std::uint32_t mixed = round == 0   ? (b & c) | (~b & d)
                                  : round == 1 ? (d & b) | (~d & c)
                                  : round == 2 ? b ^ c ^ d
                                               : c ^ (b | ~d);
      const unsigned word = round == 0   ? i
                            : round == 1 ? (5 * i + 1) % 16
                            : round == 2 ? (3 * i + 5) % 16
                                         : 7 * i % 16;
      std::uint32_t value = 0;
      for (unsigned k = 0; k < 4; ++k) {
        value |= static_cast<std::uint32_t>(static_cast<unsigned char>(text[block + 4 * word + k]))
                 << (8 * k);
      }
      const auto sine =
          static_cast<std::uint32_t>(std::floor(4294967296.0 * std::abs(std::sin(i + 1.0))));
      const std::uint32_t turned = std::rotl(a + mixed + sine + value, kTurns[round][i % 4]);
      a = d, d = c, c = b, b += turned;
    }
    sum[0] += a, sum[1] += b, sum[2] += c, sum[3] += d;
  }
  std::string digits;
  for (const std::uint32_t word : sum) {
    for (int i = 0; i < 4; ++i) {
      char two[3];
      std::snprintf(two, sizeof two, "%02x", (word >> (8 * i)) & 0xffU);
      digits += two;
    }
  }
  return digits;
}

}  // namespace sidestep::testing
