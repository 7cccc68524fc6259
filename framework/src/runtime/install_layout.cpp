#include <sidestep/runtime/install_layout.hpp>

#include <dlfcn.h>

namespace sidestep {

InstallLayout install_layout_of(const std::filesystem::path& runtime_library) {
  // <prefix>/lib, <prefix>/lib64, or <prefix>/lib/<multiarch>
  const std::filesystem::path lib = runtime_library.parent_path();
  const std::filesystem::path prefix = lib.filename().string().starts_with("lib")
                                           ? lib.parent_path()
                                           : lib.parent_path().parent_path();
  const std::filesystem::path share = prefix / "share" / "sidestep";
  return {lib / "sidestep" / "plugins", share / "robots", share / "configs"};
}

InstallLayout install_layout() {
  Dl_info info{};
  std::filesystem::path library;
  if (dladdr(reinterpret_cast<const void*>(&install_layout), &info) != 0) {
    std::error_code error;
    library = std::filesystem::weakly_canonical(info.dli_fname, error);
    if (error) library = info.dli_fname;
  }
  return install_layout_of(library);
}

}  // namespace sidestep
