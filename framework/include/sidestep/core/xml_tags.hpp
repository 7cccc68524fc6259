#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>

#include <sidestep/core/error.hpp>

namespace sidestep {

/// Calls `visit` at each tag that opens an element, with the names of the elements around it, the
/// outermost first, and its own name last. Needs no well-formed text. Comments and CDATA are passed
/// over, instructions up to `end_of_instruction`. [any]
void visit_elements(std::string_view text, std::string_view end_of_instruction,
                    const std::function<void(std::span<const std::string_view> names)>& visit);

/// Fails with kConfig where elements are nested deeper than 200, as deeply as parsers recurse.
/// [any]
[[nodiscard]] Result<void> check_xml_depth(std::string_view text, const std::string& file);

}  // namespace sidestep
