#include "sequence_testing.hpp"

#include <png.h>
#include <unistd.h>

#include <cstdio>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace sidestep::depth_sequence::testing {

void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint16_t>& values, PngKind kind) {
  std::filesystem::create_directories(file.parent_path());
  FILE* out = std::fopen(file.c_str(), "wb");
  if (out == nullptr) throw std::runtime_error("cannot write " + file.string());
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, out);
  png_set_IHDR(png, info, static_cast<png_uint_32>(width), static_cast<png_uint_32>(height),
               kind.bits, kind.colour_type, kind.interlaced ? PNG_INTERLACE_ADAM7 : 0,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  const std::size_t row_bytes = png_get_rowbytes(png, info);
  std::vector<png_byte> bytes(row_bytes * static_cast<std::size_t>(height), 0);
  for (std::size_t i = 0; i < values.size() && 2 * i + 1 < bytes.size(); ++i) {
    bytes[2 * i] = static_cast<png_byte>(values[i] >> 8);
    bytes[2 * i + 1] = static_cast<png_byte>(values[i] & 0xff);
  }
  std::vector<png_bytep> rows;
  for (int row = 0; row < height; ++row) {
    rows.push_back(bytes.data() + row_bytes * static_cast<std::size_t>(row));
  }
  png_write_image(png, rows.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(out);
}

std::string read_file(const std::filesystem::path& file) {
  std::ostringstream content;
  content << std::ifstream(file, std::ios::binary).rdbuf();
  return content.str();
}

}  // namespace sidestep::depth_sequence::testing
