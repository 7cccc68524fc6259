#include <sidestep/runtime/install_layout.hpp>

#include <dlfcn.h>

namespace sidestep {

InstallLayout install_layout() {
  Dl_info info{};
  std::filesystem::path library;
  if (dladdr(reinterpret_cast<const void*>(&install_layout), &info) != 0) {
    library = std::filesystem::weakly_canonical(info.dli_fname);
  }
  // <prefix>/lib/libsidestep_runtime.so, or <prefix>/lib/<multiarch>/libsidestep_runtime.so
  const std::filesystem::path lib = library.parent_path();
  const std::filesystem::path prefix =
      lib.filename() == "lib" ? lib.parent_path() : lib.parent_path().parent_path();
  const std::filesystem::path share = prefix / "share" / "sidestep";
  return {lib / "sidestep" / "plugins", share / "robots", share / "configs"};
}

}  // namespace sidestep
