#include "png_depth.hpp"

#include <png.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstring>
#include <fstream>
#include <span>
#include <string>

namespace sidestep::depth_sequence {
namespace {

constexpr std::array<std::uint8_t, 8> kSignature = {0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::size_t kHeaderBytes = 33;  // signature, and the IHDR chunk with its checksum
constexpr std::uint32_t kMaxSide_px = 16384;
constexpr std::size_t kMostDeflation = 1032;  // of zlib

/// What libpng's callbacks share. Plain data: libpng leaves decode() by longjmp, which skips
/// destructors.
struct Decoding {
  const std::uint8_t* data;
  std::size_t size;
  std::size_t at;
  char message[128];
  bool is_strict;  ///< A warning is a mistake: of pixels, not of what else the file says.
};

void on_error(png_structp png, png_const_charp message) {
  auto* decoding = static_cast<Decoding*>(png_get_error_ptr(png));
  std::strncpy(decoding->message, message, sizeof decoding->message - 1);
  png_longjmp(png, 1);
}

void on_warning(png_structp png, png_const_charp message) {
  const auto* decoding = static_cast<const Decoding*>(png_get_error_ptr(png));
  if (decoding->is_strict) png_error(png, message);
}

void on_read(png_structp png, png_bytep out, png_size_t count) {
  auto* decoding = static_cast<Decoding*>(png_get_io_ptr(png));
  if (decoding->size - decoding->at < count) png_error(png, "the data end too early");
  std::memcpy(out, decoding->data + decoding->at, count);
  decoding->at += count;
}

/// Fills `pixels`; on failure returns false with decoding.message set.
bool decode(Decoding& decoding, std::uint16_t* pixels, int width, int height) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &decoding, on_error, on_warning);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (info == nullptr || setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_set_read_fn(png, &decoding, on_read);
  png_read_info(png, info);
  png_set_swap(png);  // PNG is big-endian
  const int passes = png_set_interlace_handling(png);
  png_read_update_info(png, info);
  decoding.is_strict = true;
  for (int pass = 0; pass < passes; ++pass) {
    for (int row = 0; row < height; ++row) {
      png_read_row(png, reinterpret_cast<png_bytep>(pixels + std::ptrdiff_t{row} * width), nullptr);
    }
  }
  png_read_end(png, nullptr);
  if (decoding.at < decoding.size) png_error(png, "the file goes on behind the image");
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

std::uint32_t big_endian(std::span<const std::uint8_t, 4> bytes) {
  return (std::uint32_t{bytes[0]} << 24) | (std::uint32_t{bytes[1]} << 16) |
         (std::uint32_t{bytes[2]} << 8) | std::uint32_t{bytes[3]};
}

std::string channels(std::uint8_t colour_type) {
  switch (colour_type) {
    case PNG_COLOR_TYPE_GRAY: return "one channel";
    case PNG_COLOR_TYPE_GRAY_ALPHA: return "two channels";
    case PNG_COLOR_TYPE_RGB: return "three channels";
    case PNG_COLOR_TYPE_RGB_ALPHA: return "four channels";
    default: return "a palette";
  }
}

/// Reads the header itself, so that libpng only ever sees what it is meant to decode.
Result<ImageSize> parse_header(std::span<const std::uint8_t> bytes, const std::string& file) {
  if (bytes.empty()) return fail(ErrorCode::kBadFrame, "the file is empty", file);
  const std::size_t compared = std::min(bytes.size(), kSignature.size());
  if (!std::equal(kSignature.begin(), kSignature.begin() + compared, bytes.begin())) {
    return fail(ErrorCode::kBadFrame, "this is not a PNG file", file);
  }
  if (bytes.size() < kHeaderBytes) {
    return fail(ErrorCode::kBadFrame, "the file is truncated within the PNG header", file);
  }
  if (std::memcmp(bytes.data() + 12, "IHDR", 4) != 0) {
    return fail(ErrorCode::kBadFrame, "the PNG file has no header", file);
  }
  const std::uint32_t width = big_endian(bytes.subspan<16, 4>());
  const std::uint32_t height = big_endian(bytes.subspan<20, 4>());
  const std::uint8_t bits = bytes[24];
  const std::uint8_t colour_type = bytes[25];
  if (bits != 16 || colour_type != PNG_COLOR_TYPE_GRAY) {
    return fail(ErrorCode::kBadFrame,
                "the image has " + channels(colour_type) + " of " + std::to_string(bits) +
                    " bits; a depth image has one channel of 16 bits",
                file);
  }
  if (width == 0 || height == 0 || width > kMaxSide_px || height > kMaxSide_px) {
    return fail(ErrorCode::kBadFrame,
                "an image of " + std::to_string(width) + " x " + std::to_string(height) +
                    " pixels is not read",
                file);
  }
  return ImageSize{static_cast<int>(width), static_cast<int>(height)};
}

/// The first `limit` bytes of a file.
Result<std::vector<std::uint8_t>> read_bytes(const std::filesystem::path& file,
                                             std::uintmax_t limit) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    return fail(ErrorCode::kNotFound, "there is no such depth image", file.string());
  }
  const std::uintmax_t size = std::filesystem::file_size(file, error);
  std::ifstream stream(file, std::ios::binary);
  std::vector<std::uint8_t> bytes(error ? 0 : std::min(size, limit));
  stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  if (error || !stream) return fail(ErrorCode::kIo, "the file cannot be read", file.string());
  return bytes;
}

}  // namespace

Result<ImageSize> read_png_size(const std::filesystem::path& file) {
  const auto bytes = SIDESTEP_TRY(read_bytes(file, kHeaderBytes));
  return parse_header(bytes, file.string());
}

Result<RawDepth> read_png_depth(const std::filesystem::path& file) {
  const auto bytes = SIDESTEP_TRY(read_bytes(file, std::uintmax_t{1} << 30));
  const auto size = SIDESTEP_TRY(parse_header(bytes, file.string()));
  RawDepth image{size, {}};
  const std::size_t pixels =
      static_cast<std::size_t>(size.width_px) * static_cast<std::size_t>(size.height_px);
  if (pixels * sizeof(image.values[0]) > kMostDeflation * bytes.size()) {
    return fail(ErrorCode::kBadFrame,
                "the header tells of " + std::to_string(size.width_px) + " x " +
                    std::to_string(size.height_px) + " pixels, which " +
                    std::to_string(bytes.size()) + " bytes cannot hold",
                file.string());
  }
  image.values.resize(pixels);
  Decoding decoding{bytes.data(), bytes.size(), 0, {}, false};
  if (!decode(decoding, image.values.data(), size.width_px, size.height_px)) {
    return fail(ErrorCode::kBadFrame,
                std::string("the PNG data are truncated or damaged: ") + decoding.message,
                file.string());
  }
  return image;
}

}  // namespace sidestep::depth_sequence
