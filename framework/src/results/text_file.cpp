#include <sidestep/results/text_file.hpp>

#include <fstream>
#include <iterator>

namespace sidestep {

Result<std::string> read_file(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::kNotFound, "cannot read the file", file.string());
  std::string text{std::istreambuf_iterator<char>(in), {}};
  if (in.bad()) return fail(ErrorCode::kIo, "cannot read the file", file.string());
  return text;
}

Result<void> write_file(const std::filesystem::path& file, const std::string& text) {
  std::ofstream out(file, std::ios::binary);
  out << text;
  out.close();
  if (!out) return fail(ErrorCode::kIo, "cannot write the file", file.string());
  return {};
}

}  // namespace sidestep
