"""Writes compiled functions of Python as C99, which is C++ too, each as it stands: loops over elements of arrays.

Plain arithmetic alone is known: numbers, elements, rows and stretches of arrays, branches, and calls of functions of
this kind. Names of functions begin with PREFIX, which whoever writes the file replaces.
"""

import ast
import inspect
import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

from catenary.errors import InputError

_SIGNS: dict[type[ast.AST], str] = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%", ast.BitAnd: "&", ast.And: "&&", ast.Or: "||",
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip


def _bare(text: str) -> str:
    """Return an expression without the parentheses around all of it."""
    depth = 0
    for place, sign in enumerate(text):
        depth += (sign == "(") - (sign == ")")
        if depth == 0:
            return text[1:-1] if sign == ")" and place == len(text) - 1 and text[0] == "(" else text
    return text


class Value(NamedTuple):
    """A number or an array in C."""

    text: str
    kind: str  # "double" or "int"
    sizes: tuple[str, ...] = ()  # of an array, axis by axis; none of a number
    owner: str = ""  # the parameter that it is a part of


class Functions:
    """Functions of Python as C, each once, behind those that it calls."""

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._known: dict[str, _Function] = {}

    def call(self, function: Callable[..., object], args: Sequence[Value], within: "_Function | None" = None) -> Value:
        """Return the call of a function, which is written where it is not known yet."""
        plain = inspect.unwrap(function)
        name = f"PREFIX_{plain.__name__.strip('_')}"
        if name not in self._known:
            self._known[name] = _Function(name, plain, args, self)
        passed = list[str]()
        for value, (parameter, axes) in zip(args, self._known[name].taken.items(), strict=True):
            passed += [value.text, *(value.sizes[axis] for axis in axes)]
            if within is not None and parameter in self._known[name].written:
                within.written.add(value.owner)
        return Value(f"{name}({', '.join(passed)})", self._known[name].kind)


class _Function:
    """A function as C: plain arithmetic on numbers and on elements, rows and stretches of arrays."""

    def __init__(self, name: str, function: Callable[..., object], args: Sequence[Value], functions: Functions) -> None:
        self._globals, self._functions = function.__globals__, functions
        self._refusal = f"model: its step {function.__name__} cannot be written as C"
        (tree,) = ast.parse(inspect.getsource(function)).body
        assert isinstance(tree, ast.FunctionDef)  # for the type checker
        self.kind, self.written = "void", set[str]()  # what it returns, and the arrays that it writes
        self._scope: dict[str, Value] = {}
        for argument, value in zip((parameter.arg for parameter in tree.args.args), args, strict=True):
            sizes = tuple(f"{argument}_{axis}" for axis in range(len(value.sizes)))
            self._scope[argument] = Value(argument, value.kind, sizes, argument)
        parameters = dict(self._scope)
        body = "\n".join(self._block(tree.body))
        self.taken = {  # parameters, and the axes whose sizes follow them
            argument: [axis for axis, size in enumerate(value.sizes) if re.search(rf"\b{size}\b", body)]
            for argument, value in parameters.items()
        }
        takes = list[str]()
        for argument, value in parameters.items():
            pointer = (
                f"{'' if argument in self.written else 'const '}{value.kind} *" if value.sizes else f"{value.kind} "
            )
            takes += [f"{pointer}{argument}", *(f"int {argument}_{axis}" for axis in self.taken[argument])]
        own = [value for key, value in self._scope.items() if key not in parameters and not value.sizes]
        lines = [f"  {value.kind} {value.text};\n" for value in own]
        what = (ast.get_docstring(tree) or name).partition("\n")[0]
        head = f"/* {what} */\nstatic inline {self.kind} {name}({', '.join(takes)}) {{\n"
        functions.texts.append(f"{head}{''.join(lines)}{body}\n}}\n")

    def _block(self, statements: Sequence[ast.stmt]) -> list[str]:
        return [f"  {line}" for statement in statements for line in self._lines(statement)]

    def _lines(self, node: ast.stmt) -> list[str]:
        match node:
            case ast.Assign(
                targets=[ast.Tuple(elts=targets)], value=ast.Tuple(elts=values)
            ):  # of which none needs another
                return [line for pair in zip(targets, values, strict=True) for line in self._assigned(*pair)]
            case ast.Assign(targets=[target], value=value):
                return self._assigned(target, value)
            case ast.AugAssign(target=target, op=operator, value=value):
                return [f"{self._place(target).text} {_SIGNS[type(operator)]}= {self._value(value).text};"]
            case ast.For(target=ast.Name() as target, iter=ast.Call(func=ast.Name(id="range"), args=limits)):
                k = self._place(target, "int").text
                first, last, step = (*["0"] * (len(limits) == 1), *(self._value(limit).text for limit in limits), "1")[
                    :3
                ]
                return [f"for ({k} = {first}; {k} < {last}; {k} += {step}) {{", *self._block(node.body), "}"]
            case ast.If(test=test, body=body, orelse=orelse):
                others = ["} else {", *self._block(orelse)] if orelse else []
                return [f"if ({_bare(self._value(test).text)}) {{", *self._block(body), *others, "}"]
            case ast.Return(value=ast.expr() as value):
                self.kind = self._value(value).kind
                return [f"return {_bare(self._value(value).text)};"]
            case ast.Continue() | ast.Break():
                return [f"{type(node).__name__.lower()};"]
            case ast.Expr(value=ast.Constant()):
                return []  # its docstring
            case ast.Expr(value=value):
                return [f"{self._value(value).text};"]
        raise InputError(self._refusal)

    def _assigned(self, target: ast.expr, node: ast.expr) -> list[str]:
        value = self._value(node)
        if isinstance(target, ast.Name) and value.sizes:  # a part of an array by a name of its own
            self._scope[target.id] = value
            return []
        place = self._place(target, value.kind)
        if not place.sizes:
            return [f"{place.text} = {_bare(value.text)};"]
        k = self._place(ast.Name("copied"), "int").text
        return [f"for ({k} = 0; {k} < {place.sizes[0]}; ++{k}) {place.text}[{k}] = {value.text}[{k}];"]

    def _place(self, target: ast.expr, kind: str = "double") -> Value:
        """Return the C target of an assignment: a variable, declared at its first use, an element or a row."""
        if isinstance(target, ast.Name):
            name = "turn" if target.id == "_" else target.id
            return self._scope.setdefault(target.id, Value(name, kind))
        place = self._value(target)
        self.written.add(place.owner)
        return place

    def _value(self, node: ast.expr) -> Value:
        match node:
            case ast.Constant(value=int() as number):
                return Value(str(int(number)), "int")
            case ast.Constant(value=float() as number):
                return Value(repr(number), "double")
            case ast.Name(id=name) if name in self._scope:
                return self._scope[name]
            case ast.Name(id=name) if isinstance(self._globals.get(name), int | float):
                return self._value(ast.Constant(self._globals[name]))
            case ast.Attribute(attr="nan"):
                return Value("NAN", "double")
            case ast.Subscript(value=ast.Attribute(value=array, attr="shape"), slice=ast.Constant(value=int() as axis)):
                return Value(self._value(array).sizes[axis], "int")
            case ast.Subscript(value=array, slice=ast.Tuple(elts=places)):
                return self._part(self._value(array), places)
            case ast.Subscript(value=array, slice=place):
                return self._part(self._value(array), [place])
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return Value(f"!({self._value(operand).text})", "int")
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return self._value(operand)._replace(text=f"(-{self._value(operand).text})")
            case ast.BinOp(left=left, op=operator, right=right):
                is_ratio, sign = isinstance(operator, ast.Div), _SIGNS[type(operator)]
                kind = "double" if is_ratio else self._kind_of([left, right])
                cast = "(double)" if is_ratio and self._kind_of([left]) == "int" else ""
                return Value(f"({cast}{self._value(left).text} {sign} {self._value(right).text})", kind)
            case ast.BoolOp(op=operator, values=values):
                return Value(f"({f' {_SIGNS[type(operator)]} '.join(self._value(e).text for e in values)})", "int")
            case ast.Compare(left=left, ops=operators, comparators=others):
                texts = [self._value(operand).text for operand in (left, *others)]
                pairs = zip(texts, map(type, operators), texts[1:], strict=False)
                return Value(f"({' && '.join(f'{a} {_SIGNS[sign]} {b}' for a, sign, b in pairs)})", "int")
            case ast.IfExp(test=test, body=body, orelse=orelse):
                texts = [self._value(part).text for part in (test, body, orelse)]
                return Value("({} ? {} : {})".format(*texts), self._kind_of([body, orelse]))
            case ast.Call(func=ast.Name(id=name) | ast.Attribute(attr=name), args=arguments):
                return self._called(name, [self._value(argument) for argument in arguments])
        raise InputError(self._refusal)

    def _kind_of(self, nodes: Sequence[ast.expr]) -> str:
        return "double" if any(self._value(node).kind == "double" for node in nodes) else "int"

    def _part(self, array: Value, places: Sequence[ast.expr]) -> Value:
        offset, sizes = "0", array.sizes[len(places) :]
        for axis, place in enumerate(places):
            if isinstance(place, ast.Slice) and place.lower is not None and place.upper is not None:
                sizes = (f"({self._value(place.upper).text} - {self._value(place.lower).text})",)
                place = place.lower
            own = self._value(place).text
            offset = f"({offset} * {array.sizes[axis]} + {own})" if axis else own
        if not sizes:
            return Value(f"{array.text}[{_bare(offset)}]", array.kind, (), array.owner)
        for size in array.sizes[len(places) :]:
            offset = f"{offset} * {size}"
        return Value(f"({array.text} + {offset})", array.kind, sizes, array.owner)

    def _called(self, name: str, values: Sequence[Value]) -> Value:
        a, b = (values[0].text, values[-1].text) if values else ("", "")
        kind = "double" if any(value.kind == "double" for value in values) else "int"
        match name:
            case "len":
                return Value(values[0].sizes[0], "int")
            case "abs":
                return Value(f"fabs({a})", "double")
            case "sqrt":
                return Value(f"sqrt({a})", "double")
            case "int":
                return Value(f"(int)({a})", "int")
            case "isnan":
                return Value(f"({a} != {a})", "int")
            case "isfinite":
                return Value(f"({a} - {a} == 0.0)", "int")
            case "min" | "max":
                return Value(f"({b} {'<' if name == 'min' else '>'} {a} ? {b} : {a})", kind)
        if not callable(self._globals.get(name)):
            raise InputError(self._refusal)
        return self._functions.call(self._globals[name], values, self)
