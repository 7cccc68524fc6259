#include <sidestep/runtime/guarded.hpp>

namespace sidestep {

std::string text_in_flight() {
  try {
    throw;
  } catch (const std::exception& exception) {
    return exception.what();
  } catch (...) {
    return "something that is not a std::exception";
  }
}

Error error_in_flight(ErrorCode code, std::string where) {
  try {
    throw;
  } catch (const PluginThrew& threw) {
    return {ErrorCode::kPlugin,
            std::string("threw: ") + threw.what(),
            "plugin " + threw.plugin(),
            {},
            nullptr};
  } catch (...) {
    return {code, "threw: " + text_in_flight(), std::move(where), {}, nullptr};
  }
}

Error named_after(Error error, std::string_view plugin) {
  if (error.where.find(plugin) != std::string::npos) return error;
  error.where = std::string(plugin) + (error.where.empty() ? "" : ", " + error.where);
  return error;
}

}  // namespace sidestep
