#pragma once

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// All bytes of a file. Fails with kNotFound where it cannot be opened, kIo where it cannot be
/// read.
[[nodiscard]] inline Result<std::string> read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::kNotFound, "cannot read the file", file.string());
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) return fail(ErrorCode::kIo, "cannot read the file", file.string());
  return text;
}

/// Replaces the file. Fails with kIo.
[[nodiscard]] inline Result<void> write_file(const std::filesystem::path& file,
                                             const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) return fail(ErrorCode::kIo, "cannot write the file", file.string());
  return {};
}

}  // namespace sidestep
