import ast

from fmu_kit.syntax_trees import parse_module, statements

NESTED = """
import a
class C:
    import b
    def f(self):
        with self:
            import c
        for _ in ():
            from d import e
        else:
            import f
        while g:
            import h
try:
    import i
except E:
    import j
else:
    import k
finally:
    import l
match m:
    case 1:
        import n
if o:
    import p
elif q:
    import r
async def s():
    async with t:
        import u
v = lambda w: w if x else y
"""


def test_statements_are_those_of_the_whole_tree_in_its_order() -> None:
    tree = parse_module(NESTED)
    whole = [node for node in ast.walk(tree) if isinstance(node, (ast.stmt, ast.excepthandler, ast.match_case))]
    assert list(statements(tree)) == whole
    assert sum(isinstance(node, (ast.Import, ast.ImportFrom)) for node in whole) == 14
