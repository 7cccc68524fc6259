#include "byte_source.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace sidestep::bag {
namespace {

bool lies_within(std::uint64_t offset, std::size_t count, std::uint64_t size) {
  return offset <= size && count <= size - offset;
}

}  // namespace

bool MemoryBytes::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  if (!lies_within(offset, into.size(), size())) return false;
  std::ranges::copy(bytes_.subspan(offset, into.size()), into.begin());
  return true;
}

Result<std::unique_ptr<FileBytes>> FileBytes::open(const std::filesystem::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) {
    const int error = errno;
    if (error == ENOENT || error == ENOTDIR) {
      return fail(ErrorCode::kNotFound, "there is no such file", file.string());
    }
    return fail(ErrorCode::kIo, std::string("the file cannot be opened: ") + std::strerror(error),
                file.string());
  }
  struct stat status {};
  if (fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    return fail(ErrorCode::kNotFound, "this is no file", file.string());
  }
  return std::unique_ptr<FileBytes>(
      new FileBytes(descriptor, static_cast<std::uint64_t>(status.st_size)));
}

FileBytes::~FileBytes() { ::close(descriptor_); }

bool FileBytes::read(std::uint64_t offset, std::span<std::uint8_t> into) const {
  if (!lies_within(offset, into.size(), size_)) return false;
  while (!into.empty()) {
    const ssize_t count =
        ::pread(descriptor_, into.data(), into.size(), static_cast<off_t>(offset));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return false;
    offset += static_cast<std::uint64_t>(count);
    into = into.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

}  // namespace sidestep::bag
