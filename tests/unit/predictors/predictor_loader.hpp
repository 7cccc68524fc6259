#pragma once

#include <memory>
#include <string>

#include "support/host_fixture.hpp"

namespace sidestep::testing_support {

/// A predictor of this build, from its block; `scene`: what is truly there, where that is known.
[[nodiscard]] inline std::shared_ptr<Predictor> load_predictor(
    const std::string& block, std::shared_ptr<const Scene> scene = nullptr) {
  const auto fixture =
      std::make_shared<HostFixture>(std::vector<std::filesystem::path>{PLUGIN_FOLDER});
  const RunLoan loan{nullptr, nullptr, nullptr, {}, std::move(scene)};
  auto loaded = fixture->host.create<Predictor>(HostFixture::block(block), loan);
  if (!loaded) throw std::runtime_error(loaded.error().describe());
  const std::shared_ptr<Predictor> predictor(std::move(*loaded));
  return {predictor.get(), [fixture, predictor](Predictor*) {}};
}

}  // namespace sidestep::testing_support
