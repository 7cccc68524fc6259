#include <sidestep/core/file.hpp>

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <fstream>
#include <system_error>
#include <utility>

namespace sidestep {
namespace {

namespace fs = std::filesystem;

std::string size_text(std::uintmax_t bytes) {
  constexpr std::uintmax_t kMebi = std::uintmax_t{1} << 20;
  return bytes < kMebi ? std::to_string(bytes) + " bytes" : std::to_string(bytes / kMebi) + " MiB";
}

/// Waits until what a file, or folder, holds is on the disk. If not, errno says why.
bool sync(const fs::path& path) {
  const int opened = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (opened < 0) return false;
  const bool is_synced = fsync(opened) == 0;
  const int error = errno;
  close(opened);
  errno = error;
  return is_synced;
}

}  // namespace

Result<std::string> read_file(const fs::path& file, std::uintmax_t limit_bytes) {
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) {
    if (status.type() == fs::file_type::not_found) {
      return fail(ErrorCode::kNotFound, "there is no such file", file.string());
    }
    return fail(ErrorCode::kIo, "cannot be read: " + error.message(), file.string());
  }
  if (fs::is_directory(status)) {
    return fail(ErrorCode::kIo, "this is a folder, not a file", file.string());
  }
  if (!fs::is_regular_file(status)) {
    return fail(ErrorCode::kIo, "this is a pipe or a device, not a file", file.string());
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) return fail(ErrorCode::kIo, "cannot be read", file.string());
  const std::uintmax_t size = fs::file_size(file, error);
  if (error) return fail(ErrorCode::kIo, "cannot be read: " + error.message(), file.string());
  if (size > limit_bytes) {
    return fail(
        ErrorCode::kIo,
        "the file has " + size_text(size) + "; " + size_text(limit_bytes) + " at most are read",
        file.string());
  }
  std::string bytes(size, '\0');
  in.read(bytes.data(), static_cast<std::streamsize>(size));
  // One that was cut meanwhile, or of /proc, has other bytes than it says.
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  if (in.bad()) return fail(ErrorCode::kIo, "cannot be read", file.string());
  return bytes;
}

Result<void> write_file(const fs::path& file, std::string_view text) {
  std::error_code error, ignored;
  const fs::file_status status = fs::status(file, ignored);
  // What a link leads to is replaced, not the link; a pipe or a device is written to.
  const bool is_in_place = fs::exists(status) && !fs::is_regular_file(status);
  const fs::path target =
      fs::is_symlink(file, ignored) ? fs::weakly_canonical(file, ignored) : file;
  fs::path part = target;
  if (!is_in_place) part += ".part";
  errno = 0;
  std::ofstream out(part, std::ios::binary);
  out << text;
  out.close();
  const bool is_written = out && (is_in_place || sync(part));
  if (!is_written) error.assign(errno, std::generic_category());
  if (is_written && is_in_place) return {};
  if (is_written) {
    fs::rename(part, target, error);
    // Not every file system syncs folders; then the file is there by its next sync.
    if (!error) (void)sync(fs::absolute(target, ignored).parent_path());
    if (!error) return {};
  }
  if (!is_in_place) fs::remove(part, ignored);
  return fail(ErrorCode::kIo,
              "cannot be written" + (error ? ": " + error.message() : std::string()),
              file.string());
}

}  // namespace sidestep
