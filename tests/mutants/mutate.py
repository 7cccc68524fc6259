"""Writes a copy of a source in which every mutant of it is compiled in, one chosen at run time (mutants.hpp).

A mutant is one change: a comparison, + - * /, && or ||, the sign of a number or of a condition, a numeric literal, std::min
or std::max, or a statement left out. What the compiler computes is left as it is: constants, arguments of templates,
labels of cases, conditions of `if constexpr`; and so are texts of logs and what macros make. Lines keep their numbers, left_out are those of which
none is made.
"""

import re

from clang import cindex
from clang.cindex import CursorKind as Kind
from clang.cindex import TypeKind

COMPARISONS = {"<": ("less", ["<=", ">="]), "<=": ("less_equal", ["<", ">"]), ">": ("greater", [">=", "<="]),
               ">=": ("greater_equal", [">", "<"]), "==": ("equal", ["!="]), "!=": ("not_equal", ["=="])}
ARITHMETIC = {"+": ("plus", "-"), "-": ("minus", "+"), "*": ("times", "/"), "/": ("over", "*")}
ASSIGNMENTS = {"+=": ("add", "-="), "-=": ("subtract", "+="), "*=": ("scale", "/="), "/=": ("divide", "*=")}
NUMBERS = {TypeKind.INT, TypeKind.UINT, TypeKind.LONG, TypeKind.ULONG, TypeKind.LONGLONG, TypeKind.ULONGLONG, TypeKind.FLOAT,
           TypeKind.DOUBLE, TypeKind.LONGDOUBLE}
FUNCTIONS = {Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.DESTRUCTOR, Kind.CONVERSION_FUNCTION,
             Kind.FUNCTION_TEMPLATE}
TYPES = {Kind.NAMESPACE, Kind.CLASS_DECL, Kind.STRUCT_DECL, Kind.LINKAGE_SPEC, Kind.UNEXPOSED_DECL, Kind.CLASS_TEMPLATE}
JUMPS = {Kind.RETURN_STMT, Kind.CONTINUE_STMT, Kind.BREAK_STMT}


class Mutated:
    """The edits of one source, and the mutants that they bring: (line, kind, before, after), numbered from `first`."""

    def __init__(self, path, arguments, first, left_out=()):
        self.data = open(path, "rb").read()
        self.path, self.first, self.left_out = path, first, left_out
        self.mutants, self.edits, self.seen = [], [], set()
        index = cindex.Index.create()
        unit = index.parse(path, args=arguments)
        self.errors = [str(d) for d in unit.diagnostics if d.severity >= cindex.Diagnostic.Error]
        self.walk_declarations(unit.cursor)

    # The source.

    def span(self, cursor):
        """(begin, end) of what stands in this file itself; None for what a macro made."""
        start, end = cursor.extent.start, cursor.extent.end
        if not start.file or start.file.name != self.path or not end.file or end.file.name != self.path:
            return None
        if start.offset >= end.offset or b"SIDESTEP_" in self.data[start.offset:end.offset]:
            return None  # offsets of macros are not those of what they hold
        return start.offset, end.offset

    def text(self, begin, end):
        return self.data[begin:end].decode()

    def inside_macro(self, cursor):
        """Whether what a macro was given holds it: its offset is then that of the macro's name."""
        start = cursor.extent.start
        return re.match(rb"[A-Z][A-Z0-9]*_[A-Z0-9_]+\s*\(", self.data[start.offset:start.offset + 80]) is not None

    def add(self, line, kind, before, after):
        self.mutants.append((line, kind, " ".join(before.split())[:90], " ".join(after.split())[:90]))
        return self.first + len(self.mutants) - 1

    def once(self, what, begin, end):
        """Whether this may be changed and has not been seen before: kernels are compiled several times."""
        lines = range(self.data.count(b"\n", 0, begin) + 1, self.data.count(b"\n", 0, end) + 2)
        if (what, begin, end) in self.seen or any(line in self.left_out for line in lines):
            return False
        self.seen.add((what, begin, end))
        return True

    def wrap(self, begin, end, before, after):
        self.edits.append((begin, end, before, after))

    def operator(self, left, right, operators):
        """(offset, operator) between two operands."""
        between = self.text(left[1], right[0])
        found = re.fullmatch(r"[\s)]*(%s)[\s(]*" % "|".join(map(re.escape, sorted(operators, key=len, reverse=True))), between)
        # Parentheses belong to operands: clang's extents hold them. So nothing else stands between.
        return (left[1] + found.start(1), found[1]) if found and not re.search(r"[()]", between) else None

    # Declarations.

    def walk_declarations(self, cursor):
        for child in cursor.get_children():
            if child.location.file and child.location.file.name != self.path:
                continue
            if child.kind in TYPES:
                self.walk_declarations(child)
            elif child.kind in FUNCTIONS and child.is_definition():
                self.walk_function(child)

    def walk_function(self, cursor):
        for child in cursor.get_children():
            if child.kind == Kind.COMPOUND_STMT:
                self.walk_compound(child, False)
            elif child.kind.is_expression() and cursor.kind == Kind.CONSTRUCTOR:
                self.walk(child)

    # Statements.

    def walk_compound(self, cursor, is_early):
        start = cursor.extent.start.offset
        if self.data[start:start + 1] != b"{":
            return  # a macro's
        children = list(cursor.get_children())
        for i, child in enumerate(children):
            self.drop(child, is_early)
            self.walk(child, followed=is_early or i + 1 < len(children))

    def drop(self, cursor, is_early):
        """A statement may be left out where it is an assignment, a call, or leaves early."""
        start = cursor.extent.start.offset
        if not cursor.extent.start.file or cursor.extent.start.file.name != self.path:
            return
        macro = re.match(rb"SIDESTEP_TRY\s*\(", self.data[start:start + 40])
        if macro:
            end, depth = start + macro.end(), 1
            while depth:
                depth += {b"(": 1, b")": -1}.get(self.data[end:end + 1], 0)
                end += 1
        elif self.inside_macro(cursor):
            return
        else:
            end = cursor.extent.end.offset
            core = self.unwrapped(cursor)
            is_jump = cursor.kind in JUMPS
            is_effect = core.kind in (Kind.CALL_EXPR, Kind.COMPOUND_ASSIGNMENT_OPERATOR, Kind.UNARY_OPERATOR,
                                      Kind.CXX_THROW_EXPR) or \
                core.kind == Kind.BINARY_OPERATOR and re.search(rb"[^=<>!]=[^=]", self.data[start:end])
            if not (is_effect or is_jump and is_early):
                return
        text = self.text(start, end)
        if self.data[end:end + 1] != b";" or re.search(r"\blog\b", text.split("(")[0]) or not self.once("drop", start, end):
            return
        number = self.add(cursor.extent.start.line, "statement", text, "")
        self.wrap(start, end, f"if (sidestep_mutants::on({number})) {{}} else ", "")

    @staticmethod
    def unwrapped(cursor):
        while cursor.kind in (Kind.UNEXPOSED_EXPR, Kind.CSTYLE_CAST_EXPR, Kind.PAREN_EXPR):
            children = list(cursor.get_children())
            if len(children) != 1:
                break
            cursor = children[0]
        return cursor

    def walk_body(self, cursor, followed):
        """What an `if` or a loop does."""
        if cursor.kind == Kind.COMPOUND_STMT:
            self.walk_compound(cursor, followed)
        else:
            self.drop(cursor, followed)
            self.walk(cursor, followed)

    def walk(self, cursor, followed=False):
        kind = cursor.kind
        children = list(cursor.get_children())
        if kind == Kind.COMPOUND_STMT:
            return self.walk_compound(cursor, followed)
        if kind in (Kind.IF_STMT, Kind.WHILE_STMT):
            return self.walk_condition(cursor, children, followed)
        if kind in (Kind.FOR_STMT, Kind.CXX_FOR_RANGE_STMT, Kind.DO_STMT):
            body = children[0] if kind == Kind.DO_STMT else children[-1]
            for child in children:
                if child is body:
                    self.walk_body(child, True)
                else:
                    self.walk(child)
            return None
        if kind == Kind.CASE_STMT:
            return [self.walk_body(child, followed) for child in children[1:]] and None
        if kind == Kind.LAMBDA_EXPR:
            for child in children:
                if child.kind == Kind.COMPOUND_STMT:
                    self.walk_compound(child, False)
            return None
        if kind in (Kind.STATIC_ASSERT, Kind.CLASS_DECL, Kind.STRUCT_DECL, Kind.ENUM_DECL, Kind.TYPE_REF, Kind.TEMPLATE_REF):
            return None
        if kind == Kind.VAR_DECL:
            start, name = cursor.extent.start.offset, cursor.location.offset
            if re.search(rb"\b(constexpr|static)\b", self.data[start:name]):
                return None
            # What stands before the name is its type.
            children = [child for child in children if child.extent.start.offset >= name]
        if kind == Kind.DECL_STMT and re.match(rb"\s*(static|constexpr)\b", self.data[cursor.extent.start.offset:][:20]):
            return None
        if not self.inside_macro(cursor):
            self.mutate(cursor, children)
        for child in children:
            self.walk(child)
        return None

    def walk_condition(self, cursor, children, followed):
        start = cursor.extent.start.offset
        if re.match(rb"if\s+constexpr", self.data[start:start + 20]):
            return [self.walk_body(child, followed) for child in children[1:]] and None
        conditions = [child for child in children if child.kind.is_expression()]
        for child in children:
            if child.kind == Kind.VAR_DECL or child.kind == Kind.DECL_STMT:
                conditions = conditions if child.kind == Kind.DECL_STMT else []
        condition = conditions[0] if conditions else None
        for child in children:
            if child is condition:
                self.negate(child)
                self.walk(child)
            elif child.kind in (Kind.VAR_DECL, Kind.DECL_STMT):
                self.walk(child)
            elif condition is None or child.extent.start.offset > condition.extent.start.offset:
                self.walk_body(child, followed)
            else:
                self.walk(child)
        return None

    def negate(self, condition):
        """Conditions that are no comparison or negation: those are changed as such."""
        span = self.span(condition)
        inner = self.unwrapped(condition)
        text = self.text(*span) if span else ""
        if not span or text.startswith("!") or self.inside_macro(condition):
            return
        if inner.kind in (Kind.BINARY_OPERATOR, Kind.CALL_EXPR) and not re.search(r"&&|\|\|", text):
            operands = [self.span(child) for child in inner.get_children()]
            if len(operands) >= 2 and all(operands) and (self.operator(operands[0], operands[-1], COMPARISONS)):
                return
        if self.once("negate", *span):
            number = self.add(condition.extent.start.line, "condition", text, f"!({text})")
            self.wrap(*span, f"(sidestep_mutants::on({number}) != static_cast<bool>(", "))")

    # Expressions.

    def mutate(self, cursor, children):
        span = self.span(cursor)
        if not span:
            return
        kind, line, text = cursor.kind, cursor.extent.start.line, self.text(*span)
        spans = [self.span(child) for child in children]
        if kind == Kind.BINARY_OPERATOR and len(children) == 2 and all(spans):
            self.mutate_binary(cursor, span, children, spans)
        elif kind == Kind.CALL_EXPR and re.fullmatch(r"operator(==|!=|<=?|>=?|\+|-)", cursor.spelling) and len(children) >= 2:
            operands = [children[0], children[-1]]
            ends = [self.span(child) for child in operands]
            if all(ends):
                self.mutate_binary(cursor, span, operands, ends)
        elif kind == Kind.CALL_EXPR and cursor.spelling in ("min", "max"):
            found = re.match(r"std::(min|max)(<?)", text)
            if found and self.once("min", *span):
                other = {"min": "max", "max": "min"}[found[1]]
                number = self.add(line, "min and max", text, text.replace(found[1], other, 1))
                self.edits.append((span[0], span[0] + len(found[0]), None,
                                   f"sidestep_mutants::{found[1]}<{number}" + (", " if found[2] else ">")))
        elif kind == Kind.COMPOUND_ASSIGNMENT_OPERATOR and len(children) == 2 and all(spans):
            self.mutate_assignment(span, spans, line)
        elif kind == Kind.UNARY_OPERATOR and len(children) == 1 and spans[0]:
            if text.startswith("!") and self.once("not", *span):
                number = self.add(line, "condition", text, text[1:])
                self.edits.append((span[0], span[0] + 1, None, ""))
                self.wrap(*span, f"(sidestep_mutants::on({number}) == static_cast<bool>(", "))")
            elif re.match(r"-[^-]", text) and cursor.type.get_canonical().kind in NUMBERS and self.once("negative", *span):
                number = self.add(line, "arithmetic", text, text[1:])
                self.edits.append((span[0], span[0] + 1, None, ""))
                self.wrap(*span, f"sidestep_mutants::negative({number}, ", ")")
        elif kind in (Kind.INTEGER_LITERAL, Kind.FLOATING_LITERAL, Kind.CXX_BOOL_LITERAL_EXPR):
            self.mutate_literal(cursor, span, text)

    def mutate_binary(self, cursor, span, operands, spans):
        line, text = cursor.extent.start.line, self.text(*span)
        at = self.operator(*spans, {*COMPARISONS, *ARITHMETIC, "&&", "||"})
        if not at or not self.once("binary", *span):
            return
        offset, symbol = at
        canonical = cursor.type.get_canonical()

        def other(replacement):
            return text[:offset - span[0]] + replacement + text[offset - span[0] + len(symbol):]

        def call(name, numbers):
            self.wrap(*span, f"sidestep_mutants::{name}({numbers[0]}, ", ")")
            self.edits.append((offset, offset + len(symbol), None, ","))

        if symbol in COMPARISONS and canonical.kind == TypeKind.BOOL:
            name, others = COMPARISONS[symbol]
            call(name, [self.add(line, "comparison", text, other(one)) for one in others])
        elif symbol in ("&&", "||") and canonical.kind == TypeKind.BOOL:
            number = self.add(line, "logic", text, other({"&&": "||", "||": "&&"}[symbol]))
            # a || b is !(!a && !b)
            flip = f"(sidestep_mutants::on({number}) != static_cast<bool>("
            self.wrap(*span, "(" + flip, ")))")
            self.wrap(*spans[0], flip, "))")
            self.wrap(*spans[1], flip, "))")
        elif symbol in ARITHMETIC:
            name, one = ARITHMETIC[symbol]
            kinds = [operand.type.get_canonical().kind for operand in operands]
            if canonical.kind in NUMBERS and all(kind in NUMBERS for kind in kinds):
                call(name, [self.add(line, "arithmetic", text, other(one))])
            elif symbol in "+-" and "Eigen::" in canonical.spelling:
                call(name + "_all", [self.add(line, "arithmetic", text, other(one))])

    def mutate_assignment(self, span, spans, line):
        at = self.operator(*spans, ASSIGNMENTS)
        if at and self.data[span[1]:span[1] + 1] in (b";", b")") and self.once("assignment", *span):
            offset, symbol = at
            name, other = ASSIGNMENTS[symbol]
            text = self.text(*span)
            number = self.add(line, "arithmetic", text, text.replace(symbol, other, 1))
            self.wrap(*span, f"sidestep_mutants::{name}({number}, ", ")")
            self.edits.append((offset, offset + len(symbol), None, ","))

    def mutate_literal(self, cursor, span, text):
        before, after = self.data[span[0] - 1:span[0]], self.data[span[1]:span[1] + 1]
        if before == b"<" or after == b">" or before == b"[" and after == b"]" and b"{" in self.data[span[1]:span[1] + 3]:
            return
        if text in ("true", "false"):
            if self.once("literal", *span):
                number = self.add(cursor.extent.start.line, "literal", text, {"true": "false", "false": "true"}[text])
                self.wrap(*span, f"(sidestep_mutants::on({number}) != ", ")")
            return
        if not re.fullmatch(r"[\d.']+(e[+-]?\d+)?[uUlLfF]*", text) or not self.once("literal", *span):
            return
        if cursor.kind == Kind.INTEGER_LITERAL:
            other = f"({text} + 1)"
        else:
            value = float(text.rstrip("fFlL").replace("'", ""))
            other = f"({text} + 1)" if value == 0.0 else f"(2 * {text})"
        number = self.add(cursor.extent.start.line, "literal", text, other.strip("()"))
        kind = cursor.type.get_canonical().spelling
        self.wrap(*span, f"sidestep_mutants::literal<{kind}>({number}, ", f", {other})")

    # The copy.

    def source(self):
        """The source with its edits: of those that begin at one place the widest is the outermost."""
        begins, ends, instead = {}, {}, {}
        for order, (begin, end, before, after) in enumerate(self.edits):
            if before is None:
                instead[begin] = (end, after)
            else:
                begins.setdefault(begin, []).append((-end, order, before))
                ends.setdefault(end, []).append((-begin, -order, after))
        out, at = [], 0
        while at <= len(self.data):
            out += [text for _, _, text in sorted(ends.get(at, []))]
            out += [text for _, _, text in sorted(begins.get(at, []))]
            if at in instead:
                at, text = instead[at]
                out.append(text)
            elif at < len(self.data):
                out.append(self.data[at:at + 1])
                at += 1
            else:
                break
        return b'#include "mutants.hpp"\n#line 1\n' + b"".join(
            part if isinstance(part, bytes) else part.encode() for part in out)
