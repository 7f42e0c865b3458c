"""Random changes of single lines: the same seed gives the same changes, as long as the code is the same."""

import random
import re

OPERAND = r"[\w.]+(?:\(\))?(?:\[[\w.]+\])?"
BEFORE = r"(^\s*|\(|return |= |\|\| |&& |if |while |\| |=> |then\()"
AFTER = r"(?=\)|;|,| \{| &&| \|\||$)"
COMPARES = re.compile(BEFORE + rf"({OPERAND}) (<|>|<=|>=|==|!=) ({OPERAND})" + AFTER)
SUMS = re.compile(BEFORE + rf"({OPERAND}) (\+|-|\*|/) ({OPERAND})" + AFTER)
OTHERS = {"<": "<=", ">": ">=", "<=": "<", ">=": ">", "==": "!=", "!=": "==", "+": "-", "-": "+", "*": "/", "/": "*"}
CONDITION = re.compile(r"^(\s*(?:\} else )?(?:if|while) )((?!let )[^{}]*?)( \{)$")
CALL = re.compile(r"^(\s+)((?:self|[a-z_]+)(?:\.[a-z_]+)*\.[a-z_]+\([^{}|]*\);)$")
ASSIGNMENT = re.compile(r"^(\s+)((?:self\.|\*)[\w.]+(?:\[[\w.]+\])? [-+|&]?= [^{}]*;)$")
NUMBER = re.compile(r"(?<=[ (])(\d+)(?=[);, ])")
TRUTH = re.compile(r"^(\s+)(true|false)$")


def switched(old, new, switch):
    return f"(if {switch} {{ {new} }} else {{ {old} }})"


def ways(line, switch):
    """Returns all changes of a line, at its place. A change takes effect only while `switch` is true."""
    for pattern in (COMPARES, SUMS):
        for found in pattern.finditer(line):
            before, left, operator, right = found.groups()
            old, new = f"{left} {operator} {right}", f"{left} {OTHERS[operator]} {right}"
            yield new, line[: found.start()] + before + switched(old, new, switch) + line[found.end() :]
    if found := CONDITION.match(line):
        begin, condition, end = found.groups()
        if " let " not in condition:
            yield f"!({condition})", f"{begin}({condition}) != {switch}{end}"
            for one, other in (("&&", "||"), ("||", "&&")):
                if condition.count(one) == 1 and other not in condition:
                    new = condition.replace(one, other)
                    yield new, f"{begin}{switched(condition, new, switch)}{end}"
    for pattern in (CALL, ASSIGNMENT):
        if found := pattern.match(line):
            space, statement = found.groups()
            yield "nothing", f"{space}if !{switch} {{ {statement} }}"
    for found in NUMBER.finditer(line):
        number = found.group(1)
        more = str(int(number) + 1)
        yield f"{more} for {number}", line[: found.start()] + switched(number, more, switch) + line[found.end() :]
    if found := TRUTH.match(line):
        yield f"!{found.group(2)}", f"{found.group(1)}{found.group(2)} != {switch}"


def code_lines(text):
    """The numbers of the lines with product code: no tests, comments, attributes, constants."""
    for number, line in enumerate(text.split("\n")):
        if line.startswith(("#[cfg(test)]", "#[cfg(all(test")):
            return
        bare = line.strip()
        if bare.startswith(("//", "#", "const ", "pub const ", "static ", "use ", "assert", "debug_assert", "log::", "reason = ")):
            continue
        yield number, line


def drawn(files, count, switch_of):
    """Draws `count` changes of these files (name to text): the place, the new text, and the line with its switch."""
    source = random.Random("tickbus")
    sites = []
    for name, text in sorted(files.items()):
        for number, line in code_lines(text):
            found = list(ways(line, "S"))
            if found:
                sites.append((name, number, len(found)))
    source.shuffle(sites)
    changes = []
    for index, (name, number, ways_count) in enumerate(sites[:count]):
        way = source.randrange(ways_count)
        line = files[name].split("\n")[number]
        what, new = list(ways(line, switch_of(index)))[way]
        changes.append({"number": index + 1, "file": name, "line": number, "what": what, "old": line, "new": new})
    return changes
