#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <sidestep/core/log.hpp>

namespace sidestep::depth_sequence::testing {

/// A folder that is removed with this object.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::filesystem::path& parent);
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, const std::string& content) const;

 private:
  std::filesystem::path path_;
};

/// What kind of PNG write_png() makes.
struct PngKind {
  int bits = 16;
  int colour_type = 0;  ///< As PNG counts: 0 grey, 2 RGB, 6 RGBA.
  bool interlaced = false;
};

/// Writes `values` row by row; of other kinds than 16-bit grey, an image of that size.
void write_png(const std::filesystem::path& file, int width, int height,
               const std::vector<std::uint16_t>& values, PngKind kind = {});

std::string read_file(const std::filesystem::path& file);

class CollectedLog final : public Log {
 public:
  void write(LogLevel, std::string_view message) override { lines.emplace_back(message); }
  std::vector<std::string> lines;
};

}  // namespace sidestep::depth_sequence::testing
